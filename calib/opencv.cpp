// SPDX-License-Identifier: BSD-3-Clause
// OpenCV behind plain C functions. Exceptions never leave this file: each entry catches them and returns a status.
#include "calib/opencv.h"

#include <opencv2/aruco/charuco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/photo.hpp>
#include <opencv2/video/tracking.hpp>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <memory>

extern "C" {
#include "base/text.h"
}

namespace {

cv::Matx33d camera_matrix(const gonio_camera_info &c) { return {c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1}; }

cv::Vec<double, 5> distortion(const gonio_camera_info &c) { return {c.k1, c.k2, c.p1, c.p2, c.k3}; }

// Run a body that uses OpenCV; what it throws becomes a status.
template <typename Body> gonio_status guarded(gonio_error *error, const char *what, Body body) {
    try {
        return body();
    } catch (const cv::Exception &e) {
        return gonio_fail(error, GONIO_E_FAILED, "%s: %s", what, e.err.c_str());
    } catch (const std::bad_alloc &) {
        return gonio_fail(error, GONIO_E_MEMORY, "%s: not enough memory", what);
    } catch (const std::exception &e) {
        return gonio_fail(error, GONIO_E_FAILED, "%s: %s", what, e.what());
    }
}

} // namespace

extern "C" gonio_status gonio_opencv_undistort(const gonio_camera_info *camera, int n, const double *pixels,
                                               double *points, gonio_error *error) {
    return guarded(error, "undistortion", [&] {
        const cv::Mat in(n, 1, CV_64FC2, const_cast<double *>(pixels));
        cv::Mat out(n, 1, CV_64FC2, points);
        // The default of five fixed steps leaves up to 1e-3 px at strong distortion; this runs on until it has settled.
        const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 40, 1e-9);
        cv::undistortPoints(in, out, camera_matrix(*camera), distortion(*camera), cv::noArray(), cv::noArray(), until);
        if (out.ptr<double>() != points) {
            throw std::runtime_error("the result moved");
        }
        return GONIO_OK;
    });
}

extern "C" gonio_status gonio_opencv_read_image(const char *path, bool grey, int *width, int *height, int *channels,
                                                int *bits, uint16_t **pixels, gonio_error *error) {
    return guarded(error, path, [&] {
        char *data;
        size_t size;
        const gonio_status status = gonio_file_read(path, 0, &data, &size, error);
        if (status != GONIO_OK) {
            return status;
        }
        const std::unique_ptr<char, decltype(&std::free)> owner(data, &std::free);
        // From memory: of a file that it cannot decode imread warns on stderr, imdecode says nothing.
        cv::Mat image;
        if (size > 0 && size <= INT_MAX) {
            const cv::Mat bytes(1, static_cast<int>(size), CV_8U, data);
            image = cv::imdecode(bytes, cv::IMREAD_ANYDEPTH | (grey ? cv::IMREAD_GRAYSCALE : cv::IMREAD_ANYCOLOR));
        }
        if (image.empty()) {
            return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "not an image that can be read");
        }
        if ((image.depth() != CV_8U && image.depth() != CV_16U) || (image.channels() != 1 && image.channels() != 3)) {
            return gonio_fail_line(error, GONIO_E_INPUT, path, -1,
                                   "samples of another kind than 8 or 16 bits, or %d channels", image.channels());
        }
        if (image.channels() == 3) {
            cv::cvtColor(image, image, cv::COLOR_BGR2RGB);
        }
        const size_t n = image.total() * static_cast<size_t>(image.channels());
        *pixels = static_cast<uint16_t *>(std::malloc(n * sizeof **pixels));
        if (*pixels == nullptr) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for an image of %zu samples", n);
        }
        *width = image.cols;
        *height = image.rows;
        *channels = image.channels();
        *bits = image.depth() == CV_8U ? 8 : 16;
        cv::Mat out(image.rows, image.cols, CV_16UC(image.channels()), *pixels);
        image.convertTo(out, CV_16U);
        return GONIO_OK;
    });
}

extern "C" gonio_status gonio_opencv_write_image(const gonio_image *image, const char *path, gonio_error *error) {
    return guarded(error, path, [&] {
        cv::Mat out(image->height, image->width, CV_16UC(image->channels), image->pixels);
        if (image->channels == 3) {
            cv::Mat bgr;
            cv::cvtColor(out, bgr, cv::COLOR_RGB2BGR);
            out = bgr;
        }
        if (image->bits == 8) {
            cv::Mat bytes;
            out.convertTo(bytes, CV_8U);
            out = bytes;
        }
        return cv::imwrite(path, out) ? GONIO_OK : gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot write it");
    });
}

extern "C" gonio_status gonio_opencv_write_map(const char *path, int width, int height, const float *values,
                                               gonio_error *error) {
    return guarded(error, path, [&] {
        const cv::Mat map(height, width, CV_32FC1, const_cast<float *>(values));
        return cv::imwrite(path, map) ? GONIO_OK : gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot write it");
    });
}

namespace {

cv::Mat eight_bit(const gonio_image &image) {
    const cv::Mat in(image.height, image.width, CV_16UC(image.channels), image.pixels);
    cv::Mat out;
    if (image.bits == 8) {
        in.convertTo(out, CV_8U);
    } else { // detection needs contrast, not radiometry
        cv::normalize(in, out, 0, 255, cv::NORM_MINMAX, CV_8U);
    }
    if (image.channels == 3) {
        cv::cvtColor(out, out, cv::COLOR_RGB2GRAY);
    }
    return out;
}

bool find_chessboard(const cv::Mat &image, const gonio_board &board, int half_window, gonio_corners &corners) {
    const cv::Size size(board.columns, board.rows);
    std::vector<cv::Point2f> found;
    if (!cv::findChessboardCorners(image, size, found, cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE)) {
        return false;
    }
    const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-4);
    cv::cornerSubPix(image, found, cv::Size(half_window, half_window), cv::Size(-1, -1), until);
    corners.n = 0;
    for (const cv::Point2f &c : found) {
        const int i = corners.n++;
        corners.pixel[i][0] = c.x;
        corners.pixel[i][1] = c.y;
        corners.board[i][0] = board.square_mm * (i % board.columns);
        corners.board[i][1] = board.square_mm * (i / board.columns);
    }
    return true;
}

cv::Ptr<cv::aruco::CharucoBoard> charuco_pattern(const gonio_board &board) {
    const auto dictionary =
        cv::aruco::getPredefinedDictionary(static_cast<cv::aruco::PREDEFINED_DICTIONARY_NAME>(board.dictionary));
    return cv::aruco::CharucoBoard::create(board.columns, board.rows, static_cast<float>(board.square_mm),
                                           static_cast<float>(board.marker_mm), dictionary);
}

// Half the sub-pixel window about ChArUco corners: it must not reach the markers' own corners, which on a board that is
// seen obliquely come close and would pull (0.3 px at 60 deg with +-5 px). The distance in the image is the gap on the
// board times the smallest scale of the homography between them.
int charuco_window(const gonio_board &board, const std::vector<cv::Point2f> &on_board,
                   const std::vector<cv::Point2f> &found, int half_window) {
    const cv::Mat h = found.size() >= 4 ? cv::findHomography(on_board, found) : cv::Mat();
    if (h.empty()) {
        return half_window;
    }
    const cv::Matx33d m = h;
    double smallest = INFINITY;
    for (const cv::Point2f &p : on_board) {
        const double w = m(2, 0) * p.x + m(2, 1) * p.y + m(2, 2);
        const double u = (m(0, 0) * p.x + m(0, 1) * p.y + m(0, 2)) / w,
                     v = (m(1, 0) * p.x + m(1, 1) * p.y + m(1, 2)) / w;
        const double a = (m(0, 0) - u * m(2, 0)) / w, b = (m(0, 1) - u * m(2, 1)) / w;
        const double c = (m(1, 0) - v * m(2, 0)) / w, d = (m(1, 1) - v * m(2, 1)) / w;
        const double sum = a * a + b * b + c * c + d * d, product = std::abs(a * d - b * c);
        smallest =
            std::min(smallest,
                     std::sqrt(std::max(0.0, (sum - std::sqrt(std::max(0.0, sum * sum - 4 * product * product))) / 2)));
    }
    const double gap_px = (board.square_mm - board.marker_mm) / 2 * smallest;
    // Below +-2 px there is too little of an edge to find.
    return std::clamp(static_cast<int>(gap_px - 0.5), std::min(2, half_window), half_window);
}

int find_charuco(const cv::Mat &image, const gonio_board &board, int half_window, gonio_corners &corners) {
    const auto pattern = charuco_pattern(board);
    std::vector<std::vector<cv::Point2f>> markers;
    std::vector<int> ids;
    cv::aruco::detectMarkers(image, pattern->dictionary, markers, ids);
    corners.n = 0;
    if (ids.empty()) {
        return 0;
    }
    std::vector<cv::Point2f> found;
    std::vector<int> found_ids;
    cv::aruco::interpolateCornersCharuco(markers, ids, image, pattern, found, found_ids);
    std::vector<cv::Point2f> on_board;
    for (const int id : found_ids) {
        const cv::Point3f &at = pattern->chessboardCorners[static_cast<size_t>(id)];
        on_board.emplace_back(at.x, at.y);
    }
    if (!found.empty()) {
        const int window = charuco_window(board, on_board, found, half_window);
        const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-4);
        cv::cornerSubPix(image, found, cv::Size(window, window), cv::Size(-1, -1), until);
    }
    for (size_t k = 0; k < found.size(); k++) {
        const int i = corners.n++;
        corners.pixel[i][0] = found[k].x;
        corners.pixel[i][1] = found[k].y;
        corners.board[i][0] = on_board[k].x;
        corners.board[i][1] = on_board[k].y;
    }
    return static_cast<int>(ids.size());
}

} // namespace

extern "C" gonio_status gonio_opencv_draw_board(const gonio_board *board, int square_px, gonio_image *image,
                                                gonio_error *error) {
    return guarded(error, "board", [&] {
        const bool charuco = board->kind == GONIO_CHARUCO;
        const int columns = board->columns + (charuco ? 0 : 1), rows = board->rows + (charuco ? 0 : 1);
        const cv::Size size((columns + 2) * square_px, (rows + 2) * square_px);
        cv::Mat drawn(size, CV_8U, cv::Scalar(255));
        if (charuco) {
            charuco_pattern(*board)->draw(size, drawn, square_px);
        }
        for (int k = 0; !charuco && k < columns * rows; k++) {
            if ((k % columns + k / columns) % 2 == 0) {
                const cv::Rect square((1 + k % columns) * square_px, (1 + k / columns) * square_px, square_px,
                                      square_px);
                drawn(square).setTo(0);
            }
        }
        const size_t n = drawn.total();
        *image = {drawn.cols, drawn.rows, 1, 8, static_cast<uint16_t *>(std::malloc(n * sizeof(uint16_t)))};
        if (image->pixels == nullptr) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for a board of %d x %d pixels", drawn.cols, drawn.rows);
        }
        cv::Mat out(drawn.rows, drawn.cols, CV_16U, image->pixels);
        drawn.convertTo(out, CV_16U);
        return GONIO_OK;
    });
}

extern "C" gonio_status gonio_opencv_find_board(const gonio_image *image, const gonio_board *board, int half_window,
                                                gonio_corners *corners, gonio_error *error) {
    return guarded(error, "board detection", [&] {
        const cv::Mat grey = eight_bit(*image);
        if (board->kind == GONIO_CHESSBOARD) {
            return find_chessboard(grey, *board, half_window, *corners)
                       ? GONIO_OK
                       : gonio_fail(error, GONIO_E_INPUT, "no chessboard of %d x %d inner corners found",
                                    board->columns, board->rows);
        }
        const int markers = find_charuco(grey, *board, half_window, *corners);
        if (corners->n >= 6) {
            return GONIO_OK;
        }
        cv::Mat flipped;
        gonio_corners mirrored;
        cv::flip(grey, flipped, 1);
        const bool other = find_charuco(flipped, *board, half_window, mirrored) > markers;
        const int n = corners->n;
        corners->n = 0;
        return other ? gonio_fail(error, GONIO_E_INPUT, "the board is mirrored")
                     : gonio_fail(error, GONIO_E_INPUT, "no ChArUco board found: %d markers, %d corners of %d", markers,
                                  n, (board->columns - 1) * (board->rows - 1));
    });
}

extern "C" gonio_status gonio_opencv_calibrate(int n, const gonio_corners *corners, int radial, gonio_view *views,
                                               gonio_camera_calibration *out, gonio_error *error) {
    return guarded(error, "camera calibration", [&] {
        std::vector<std::vector<cv::Point3f>> object;
        std::vector<std::vector<cv::Point2f>> image;
        size_t points = 0;
        for (int i = 0; i < n; i++) {
            if (!views[i].used) {
                continue;
            }
            object.emplace_back();
            image.emplace_back();
            for (int k = 0; k < corners[i].n; k++) {
                object.back().emplace_back(corners[i].board[k][0], corners[i].board[k][1], 0);
                image.back().emplace_back(corners[i].pixel[k][0], corners[i].pixel[k][1]);
            }
            points += image.back().size();
        }
        cv::Mat matrix, distortion, sigma, view_sigma, errors;
        std::vector<cv::Mat> rotation, translation;
        const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 200, 1e-12);
        out->rms = cv::calibrateCamera(
            object, image, cv::Size(out->width, out->height), matrix, distortion, rotation, translation, sigma,
            view_sigma, errors, (radial < 3 ? cv::CALIB_FIX_K3 : 0) | (radial < 2 ? cv::CALIB_FIX_K2 : 0), until);
        const double values[9] = {matrix.at<double>(0, 0),  matrix.at<double>(1, 1),  matrix.at<double>(0, 2),
                                  matrix.at<double>(1, 2),  distortion.at<double>(0), distortion.at<double>(1),
                                  distortion.at<double>(2), distortion.at<double>(3), distortion.at<double>(4)};
        // OpenCV 4.6 divides the squared residuals of both coordinates by the number of points less the parameters,
        // which makes its standard deviations too large by sqrt((2 points - parameters) / (points - parameters)).
        const double parameters = 6 + radial + 6 * static_cast<double>(image.size()), m = static_cast<double>(points);
        const double correction = m > parameters ? std::sqrt((m - parameters) / (2 * m - parameters)) : 1;
        for (int k = 0; k < 9; k++) {
            out->value[k] = values[k];
            out->sigma[k] = sigma.at<double>(k) * correction;
        }
        for (int i = 0, used = 0; i < n; i++) {
            if (views[i].used) {
                views[i].rms = errors.at<double>(used);
                for (int k = 0; k < 3; k++) {
                    views[i].rotation[k] = rotation[static_cast<size_t>(used)].at<double>(k);
                    views[i].translation_mm[k] = translation[static_cast<size_t>(used)].at<double>(k);
                }
                used++;
            }
        }
        return GONIO_OK;
    });
}

extern "C" gonio_status gonio_opencv_undistortion_map(const gonio_camera_info *camera, float *map, gonio_error *error) {
    return guarded(error, "undistortion map", [&] {
        cv::Mat out, unused;
        cv::initUndistortRectifyMap(camera_matrix(*camera), distortion(*camera), cv::noArray(), camera_matrix(*camera),
                                    cv::Size(camera->width, camera->height), CV_32FC2, out, unused);
        std::memcpy(map, out.ptr<float>(), out.total() * 2 * sizeof *map);
        return GONIO_OK;
    });
}

extern "C" gonio_status gonio_opencv_response(bool robertson, int n, const gonio_image *images, int channel,
                                              const double *exposure_s, double exposure[256], gonio_error *error) {
    return guarded(error, "response", [&] {
        std::vector<cv::Mat> frames;
        std::vector<float> times;
        for (int i = 0; i < n; i++) {
            const cv::Mat whole(images[i].height, images[i].width, CV_16UC(images[i].channels), images[i].pixels);
            cv::Mat one;
            cv::extractChannel(whole, one, channel);
            one.convertTo(one, CV_8U);
            // OpenCV 4.6's Robertson writes three channels whatever the images have.
            cv::merge(std::vector<cv::Mat>(3, one), one);
            frames.push_back(one);
            times.push_back(static_cast<float>(exposure_s[i]));
        }
        cv::Mat response;
        if (robertson) {
            cv::createCalibrateRobertson()->process(frames, response, times);
        } else {
            cv::createCalibrateDebevec(200)->process(frames, response, times);
        }
        for (int v = 0; v < 256; v++) {
            exposure[v] = response.at<cv::Vec3f>(v)[0];
        }
        return GONIO_OK;
    });
}

extern "C" gonio_status gonio_opencv_shift(const gonio_image *onto, const gonio_image *image, int shift[2],
                                           gonio_error *error) {
    return guarded(error, "alignment", [&] {
        const cv::Point found = cv::createAlignMTB()->calculateShift(eight_bit(*onto), eight_bit(*image));
        shift[0] = found.x;
        shift[1] = found.y;
        return GONIO_OK;
    });
}

namespace {

// Evangelidis and Psarakis' enhanced correlation (PAMI 2008) from a first guess; below 0 where it does not converge.
double refine_translation(const cv::Mat &from, const cv::Mat &to, cv::Point2d &shift) {
    cv::Mat warp = (cv::Mat_<float>(2, 3) << 1, 0, shift.x, 0, 1, shift.y);
    const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-9);
    try {
        const double correlation =
            cv::findTransformECC(from, to, warp, cv::MOTION_TRANSLATION, until, cv::noArray(), 5);
        shift = {warp.at<float>(0, 2), warp.at<float>(1, 2)};
        return correlation;
    } catch (const cv::Exception &) {
        return -1;
    }
}

cv::Mat as_float(const gonio_image &image) {
    const cv::Mat in(image.height, image.width, CV_16U, image.pixels);
    cv::Mat out;
    in.convertTo(out, CV_32F);
    cv::medianBlur(out, out, 3); // hot pixels would hold the correlation at 0
    return out;
}

// What has edges: between the scales of 3 and 12 px. Vignetting is fixed to the sensor and would hold it at 0 too.
cv::Mat edges_of(const cv::Mat &image) {
    cv::Mat fine, coarse;
    cv::GaussianBlur(image, fine, cv::Size(0, 0), 3);
    cv::GaussianBlur(image, coarse, cv::Size(0, 0), 12);
    return fine - coarse;
}

} // namespace

extern "C" gonio_status gonio_opencv_translation(const gonio_image *from, const gonio_image *to, double shift[2],
                                                 double *correlation, double *structure, gonio_error *error) {
    return guarded(error, "comparison of frames", [&] {
        const cv::Mat raw = as_float(*from), a = edges_of(raw), b = edges_of(as_float(*to));
        cv::Mat smooth, window;
        cv::GaussianBlur(raw, smooth, cv::Size(0, 0), 3);
        cv::Scalar mean, contrast, noise;
        cv::meanStdDev(a, mean, contrast);
        cv::meanStdDev(raw - smooth, mean, noise);
        *structure = contrast[0] / std::max(noise[0], 1e-9);
        // From where it was, and from where phase correlation sees it: the better of the two.
        cv::createHanningWindow(window, a.size(), CV_32F);
        cv::Point2d still(0, 0), moved = cv::phaseCorrelate(a, b, window);
        const double at_rest = refine_translation(a, b, still), in_motion = refine_translation(a, b, moved);
        const cv::Point2d &best = in_motion > at_rest ? moved : still;
        *correlation = std::max(at_rest, in_motion);
        shift[0] = best.x;
        shift[1] = best.y;
        return GONIO_OK;
    });
}
