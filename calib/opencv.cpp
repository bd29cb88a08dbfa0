// OpenCV behind plain C functions. Exceptions never leave this file: each entry catches them and returns a status.
#include "calib/opencv.h"

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

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

extern "C" gonio_status opencv_undistort(const gonio_camera_info *camera, int n, const double *pixels, double *points,
                                         gonio_error *error) {
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
