// SPDX-License-Identifier: BSD-3-Clause
// OpenEXR pictures, by OpenEXR's library.
#include "scene/image_formats.h"

#include <cstdlib>
#include <exception>
#include <stdexcept>
#include <vector>

#include <ImfArray.h>
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>

namespace {

class in_stream : public Imf::IStream {
  public:
    in_stream(FILE *file, const char *path) : Imf::IStream(path), file_(file) {}
    bool read(char c[], int n) override {
        if (n < 0 || fread(c, 1, static_cast<size_t>(n), file_) != static_cast<size_t>(n)) {
            throw std::runtime_error("the file ends too early");
        }
        const int next = getc(file_);
        ungetc(next, file_);
        return next != EOF;
    }
    uint64_t tellg() override { return static_cast<uint64_t>(ftello(file_)); }
    void seekg(uint64_t at) override {
        if (fseeko(file_, static_cast<off_t>(at), SEEK_SET) != 0) {
            throw std::runtime_error("it points outside itself");
        }
    }

  private:
    FILE *file_;
};

class out_stream : public Imf::OStream {
  public:
    out_stream(FILE *file, const char *path) : Imf::OStream(path), file_(file) {}
    void write(const char c[], int n) override {
        if (n < 0 || fwrite(c, 1, static_cast<size_t>(n), file_) != static_cast<size_t>(n)) {
            throw std::runtime_error("the disk or the pipe takes no more");
        }
    }
    uint64_t tellp() override {
        const off_t at = ftello(file_);
        if (at < 0) {
            throw std::runtime_error("an EXR file cannot go to a pipe");
        }
        return static_cast<uint64_t>(at);
    }
    void seekp(uint64_t at) override {
        if (fseeko(file_, static_cast<off_t>(at), SEEK_SET) != 0) {
            throw std::runtime_error("an EXR file cannot go to a pipe");
        }
    }

  private:
    FILE *file_;
};

// The channels that are red, green and blue: of those names, else one for all, luminance or the first there is.
bool find_channels(const Imf::ChannelList &channels, const char *names[3]) {
    if (channels.findChannel("R") != nullptr && channels.findChannel("G") != nullptr &&
        channels.findChannel("B") != nullptr) {
        names[0] = "R";
        names[1] = "G";
        names[2] = "B";
        return true;
    }
    if (channels.begin() == channels.end()) {
        return false;
    }
    names[0] = names[1] = names[2] = channels.findChannel("Y") != nullptr ? "Y" : channels.begin().name();
    return true;
}

void read_all(Imf::InputFile &file, const char *const names[3], gonio_picture *image) {
    const Imath::Box2i box = file.header().dataWindow();
    const size_t pixels = static_cast<size_t>(image->width) * static_cast<size_t>(image->height);
    std::vector<float> plane(pixels);
    for (int c = 0; c < 3; c++) {
        if (c == 0 || names[c] != names[0]) {
            Imf::FrameBuffer buffer;
            buffer.insert(names[c], Imf::Slice::Make(Imf::FLOAT, plane.data(), box));
            file.setFrameBuffer(buffer);
            file.readPixels(box.min.y, box.max.y);
        }
        for (size_t i = 0; i < pixels; i++) {
            image->rgb[3 * i + static_cast<size_t>(c)] = plane[i];
        }
    }
}

} // namespace

gonio_status gonio_scene_exr_read(FILE *file, const char *path, gonio_picture **out, gonio_error *error) {
    try {
        in_stream stream(file, path);
        Imf::InputFile exr(stream, 0);
        const Imath::Box2i box = exr.header().dataWindow();
        const double width = double(box.max.x) - box.min.x + 1, height = double(box.max.y) - box.min.y + 1;
        if (!(width >= 1 && height >= 1 && width <= SCENE_IMAGE_SIDE_MAX && height <= SCENE_IMAGE_SIDE_MAX)) {
            return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "a picture of %g x %g pixels", width, height);
        }
        const char *names[3];
        if (!find_channels(exr.header().channels(), names)) {
            return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "an EXR picture without channels");
        }
        const gonio_status status = gonio_scene_picture_new(int(width), int(height), out, error);
        if (status == GONIO_OK) {
            read_all(exr, names, *out);
        }
        return status;
    } catch (const std::bad_alloc &) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %s", path);
    } catch (const std::exception &e) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "not an EXR picture that can be read: %.300s", e.what());
    }
}

gonio_status gonio_scene_exr_write(const gonio_picture *image, FILE *file, const char *path, gonio_error *error) {
    try {
        Imf::Header header(image->width, image->height);
        Imf::FrameBuffer buffer;
        static const char *const names[3] = {"R", "G", "B"};
        const size_t pixel = 3 * sizeof(float);
        for (int c = 0; c < 3; c++) {
            header.channels().insert(names[c], Imf::Channel(Imf::FLOAT));
            buffer.insert(names[c], Imf::Slice(Imf::FLOAT, reinterpret_cast<char *>(image->rgb + c), pixel,
                                               pixel * static_cast<size_t>(image->width)));
        }
        out_stream stream(file, path);
        Imf::OutputFile exr(stream, header, 0);
        exr.setFrameBuffer(buffer);
        exr.writePixels(image->height);
        return GONIO_OK;
    } catch (const std::exception &e) {
        return gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot write it: %.300s", e.what());
    }
}
