// oiio.cpp - the one place that speaks to OpenImageIO. See oiio.h and image.h.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <exception>
#include <memory>
#include <mutex>
#include <new>
#include <string>
#include <vector>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

// C lets a struct and a function share a name; C++ warns that one hides the other.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow"
extern "C" {
#include "base/alloc.h"
#include "renderer/image/oiio.h"
}
#pragma GCC diagnostic pop

namespace
{

using OIIO::ImageInput;
using OIIO::ImageOutput;
using OIIO::ImageSpec;
using OIIO::TypeDesc;

constexpr int max_channels = 256;

// Library-wide switches, once per process. Parallelism is above: images decode side by side.
void set_up_library()
{
    static std::once_flag once;
    std::call_once(once, [] {
        OIIO::attribute("threads", 1);
        OIIO::attribute("exr_threads", -1);
        OIIO::attribute("limits:imagesize_MB", 2048);
        OIIO::attribute("limits:channels", max_channels);
    });
}

// OpenImageIO's texts may have several lines; ours have one.
std::string one_line(std::string text)
{
    while (!text.empty() && (text.back() == '\n' || text.back() == ' '))
        text.pop_back();
    std::replace(text.begin(), text.end(), '\n', ' ');
    return text.empty() ? "the decoder gave no reason" : text;
}

hg_status fail(hg_error *err, hg_status status, const char *name, const std::string &reason)
{
    return hg_error_set(err, status, name, nullptr, "%s", one_line(reason).c_str());
}

// Runs `work`, which returns a status, and turns what it throws into one.
template <class Work> hg_status guarded(const char *name, hg_error *err, Work work) noexcept
{
    try {
        return work();
    } catch (const std::bad_alloc &) {
        return hg_error_set(err, HG_E_NOMEM, name, nullptr, "no memory to decode or encode");
    } catch (const std::exception &e) {
        return hg_error_set(err, HG_E_FORMAT, name, nullptr, "%s", e.what());
    } catch (...) {
        return hg_error_set(err, HG_E_FORMAT, name, nullptr, "the image library failed");
    }
}

// An opened image; the reader borrows the proxy, so the order of members matters.
struct Source {
    OIIO::Filesystem::IOMemReader memory;
    std::unique_ptr<ImageInput> input;
    ImageSpec spec;

    Source(const void *data, size_t size) : memory(const_cast<void *>(data), size)
    {
    }
};

hg_status open_source(Source &source, const char *name, const char *format, hg_error *err)
{
    set_up_library();
    source.input = ImageInput::create(format, false, nullptr, nullptr, "");
    if (!source.input)
        return fail(err, HG_E_UNSUPPORTED, name,
            std::string("this OpenImageIO cannot read ") + format + ": " + OIIO::geterror());
    ImageSpec config;
    config.attribute("oiio:UnassociatedAlpha", 1);
    if (!source.input->set_ioproxy(&source.memory))
        return fail(err, HG_E_UNSUPPORTED, name,
            std::string("this OpenImageIO cannot read ") + format + " from memory");
    if (!source.input->open(std::string("memory.") + format, source.spec, config))
        return fail(err, HG_E_FORMAT, name, source.input->geterror());
    const ImageSpec &s = source.spec;
    if (s.width < 1 || s.height < 1 || s.depth > 1 || s.nchannels < 1)
        return fail(err, HG_E_FORMAT, name, "no pixels");
    return HG_OK;
}

hg_status check_limits(const ImageSpec &s, const char *name, size_t pixel_bytes,
    const hg_image_limits &l, hg_error *err)
{
    uint64_t width = uint64_t(s.width), height = uint64_t(s.height), pixels = width * height;
    if (width > l.max_side_px || height > l.max_side_px)
        return hg_error_set(err, HG_E_LIMIT, name, "size", "%dx%d px is more than %u a side",
            s.width, s.height, l.max_side_px);
    if (pixels > l.max_pixels || pixels > l.max_bytes / pixel_bytes)
        return hg_error_set(
            err, HG_E_LIMIT, name, "size", "%dx%d px is more than allowed", s.width, s.height);
    if (s.nchannels > max_channels)
        return hg_error_set(
            err, HG_E_LIMIT, name, "channels", "%d is more than %d", s.nchannels, max_channels);
    // One tile or one row is taken whole by the decoder.
    uint64_t tile = uint64_t(std::max(s.tile_width, 1)) * uint64_t(std::max(s.tile_height, 1));
    if (tile > l.max_pixels || tile > l.max_bytes / std::max<uint64_t>(s.pixel_bytes(true), 1))
        return hg_error_set(err, HG_E_LIMIT, name, "tile", "%dx%d px is more than allowed",
            s.tile_width, s.tile_height);
    return HG_OK;
}

TypeDesc type_of(hg_pixel_format format)
{
    switch (format) {
    case HG_PIXEL_RGBA8:
        return TypeDesc::UINT8;
    case HG_PIXEL_RGBA16:
        return TypeDesc::UINT16;
    case HG_PIXEL_RGBA32F:
        break;
    }
    return TypeDesc::FLOAT;
}

// How many of the file's first channels are read: grey, grey + alpha, RGB or RGBA.
int channels_to_read(const ImageSpec &s)
{
    if (s.nchannels >= 4 && s.alpha_channel == 3)
        return 4;
    if (s.nchannels >= 3 && s.alpha_channel != 1)
        return 3;
    return s.nchannels >= 2 && s.alpha_channel == 1 ? 2 : 1;
}

// Spreads tightly packed pixels of n channels to RGBA in place, from the last pixel backwards.
template <class T> void spread_to_rgba(T *px, size_t count, int n, T one)
{
    for (size_t i = count; n < 4 && i-- > 0;) {
        const T *s = px + i * size_t(n);
        T r = s[0], g = n >= 3 ? s[1] : r, b = n >= 3 ? s[2] : r, a = n == 2 ? s[1] : one;
        T *d = px + i * 4;
        d[0] = r;
        d[1] = g;
        d[2] = b;
        d[3] = a;
    }
}

void spread(hg_image *image, int channels)
{
    size_t count = size_t(image->width) * image->height;
    if (image->format == HG_PIXEL_RGBA8)
        spread_to_rgba(static_cast<uint8_t *>(image->pixels), count, channels, uint8_t(255));
    else if (image->format == HG_PIXEL_RGBA16)
        spread_to_rgba(static_cast<uint16_t *>(image->pixels), count, channels, uint16_t(65535));
    else
        spread_to_rgba(static_cast<float *>(image->pixels), count, channels, 1.0f);
}

// Files that store colour times alpha (EXR, some TIFF) become straight alpha.
template <class T> void divide_alpha(T *px, size_t count, float one)
{
    for (size_t i = 0; i < count; i++, px += 4) {
        float a = float(px[3]) / one;
        if (a <= 0 || a >= 1)
            continue;
        for (int c = 0; c < 3; c++) {
            float v = float(px[c]) / a;
            px[c] = one == 1.0f ? T(v) : T(std::min(v, one) + 0.5f);
        }
    }
}

void make_straight(hg_image *image)
{
    size_t count = size_t(image->width) * image->height;
    if (image->format == HG_PIXEL_RGBA8)
        divide_alpha(static_cast<uint8_t *>(image->pixels), count, 255.0f);
    else if (image->format == HG_PIXEL_RGBA16)
        divide_alpha(static_cast<uint16_t *>(image->pixels), count, 65535.0f);
    else
        divide_alpha(static_cast<float *>(image->pixels), count, 1.0f);
}

hg_status read_pixels(Source &source, const char *name, hg_image *image, hg_error *err)
{
    int channels = channels_to_read(source.spec);
    if (!source.input->read_image(0, 0, 0, channels, type_of(image->format), image->pixels))
        return fail(err, HG_E_FORMAT, name, source.input->geterror());
    spread(image, channels);
    image->has_alpha = channels == 2 || channels == 4;
    if (image->has_alpha && source.spec.get_int_attribute("oiio:UnassociatedAlpha", 0) == 0)
        make_straight(image);
    return HG_OK;
}

hg_status read_image(Source &source, const char *name, hg_pixel_format format,
    const hg_image_limits &limits, hg_image *out, hg_error *err)
{
    const ImageSpec &s = source.spec;
    hg_status st = check_limits(s, name, hg_pixel_bytes(format), limits, err);
    if (st)
        return st;
    st = hg_image_create(uint32_t(s.width), uint32_t(s.height), format, &limits, out);
    if (st)
        return hg_error_set(err, st, name, "size", "no memory for %dx%d px", s.width, s.height);
    st = read_pixels(source, name, out, err);
    if (st)
        hg_image_finish(out);
    return st;
}

bool is_exr(hg_image_file file)
{
    return file == HG_IMAGE_EXR_HALF || file == HG_IMAGE_EXR_FLOAT;
}

TypeDesc file_type(hg_image_file file)
{
    switch (file) {
    case HG_IMAGE_PNG16:
        return TypeDesc::UINT16;
    case HG_IMAGE_EXR_HALF:
        return TypeDesc::HALF;
    case HG_IMAGE_EXR_FLOAT:
        return TypeDesc::FLOAT;
    case HG_IMAGE_PNG8:
    case HG_IMAGE_JPEG:
        break;
    }
    return TypeDesc::UINT8;
}

// PNG keeps attributes as text; EXR keeps their types.
void add_text(ImageSpec &spec, const hg_image_attribute &a)
{
    char text[400] = "";
    size_t at = 0, count = a.type == hg_image_attribute::HG_ATTR_MAT4 ? 16 : 1;
    if (a.type == hg_image_attribute::HG_ATTR_STRING) {
        spec.attribute(a.name, a.string);
        return;
    }
    if (a.type == hg_image_attribute::HG_ATTR_INT)
        snprintf(text, sizeof text, "%d", a.integer);
    else
        for (size_t i = 0; i < count && at < sizeof text; i++)
            at += size_t(
                snprintf(text + at, sizeof text - at, i ? " %.9g" : "%.9g", double(a.floats[i])));
    spec.attribute(a.name, text);
}

void add_typed(ImageSpec &spec, const hg_image_attribute &a)
{
    switch (a.type) {
    case hg_image_attribute::HG_ATTR_STRING:
        spec.attribute(a.name, a.string);
        break;
    case hg_image_attribute::HG_ATTR_INT:
        spec.attribute(a.name, a.integer);
        break;
    case hg_image_attribute::HG_ATTR_FLOAT:
        spec.attribute(a.name, a.floats[0]);
        break;
    case hg_image_attribute::HG_ATTR_MAT4:
        spec.attribute(a.name, OIIO::TypeMatrix44, a.floats);
        break;
    }
}

ImageSpec make_spec(const hg_image *image, const struct hg_image_encode *params)
{
    static const float rec709[8] = {0.64f, 0.33f, 0.30f, 0.60f, 0.15f, 0.06f, 0.3127f, 0.3290f};
    ImageSpec spec(
        int(image->width), int(image->height), params->opaque ? 3 : 4, file_type(params->file));
    if (is_exr(params->file)) {
        spec.attribute("compression", "zip");
        spec.attribute("chromaticities", TypeDesc(TypeDesc::FLOAT, 8), rec709);
        spec.attribute("DateTime", ""); // else the writer puts the present time into the file
    } else {
        spec.attribute("oiio:ColorSpace", "sRGB");
        spec.attribute("oiio:UnassociatedAlpha", 1);
        spec.attribute("png:compressionLevel", 3);
    }
    for (size_t i = 0; i < params->attribute_count; i++)
        (is_exr(params->file) ? add_typed : add_text)(spec, params->attributes[i]);
    return spec;
}

// EXR holds colour times alpha by definition of the format.
std::vector<float> multiply_alpha(const hg_image *image)
{
    size_t count = size_t(image->width) * image->height;
    const float *s = static_cast<const float *>(image->pixels);
    std::vector<float> out(s, s + count * 4);
    for (size_t i = 0; i < count; i++)
        for (int c = 0; c < 3; c++)
            out[i * 4 + size_t(c)] *= out[i * 4 + 3];
    return out;
}

hg_status write_pixels(
    ImageOutput &output, const hg_image *image, const struct hg_image_encode *params)
{
    OIIO::stride_t xstride = OIIO::stride_t(hg_pixel_bytes(image->format));
    const void *pixels = image->pixels;
    std::vector<float> associated;
    if (is_exr(params->file) && !params->opaque) {
        associated = multiply_alpha(image);
        pixels = associated.data();
    }
    return output.write_image(type_of(image->format), pixels, xstride) ? HG_OK : HG_E_IO;
}

hg_status encode(
    const hg_image *image, const struct hg_image_encode *params, hg_writer *out, hg_error *err)
{
    set_up_library();
    const char *format = is_exr(params->file) ? "openexr" : "png";
    std::vector<unsigned char> bytes;
    OIIO::Filesystem::IOVecOutput memory(bytes);
    std::unique_ptr<ImageOutput> output = ImageOutput::create(format);
    if (!output || !output->set_ioproxy(&memory))
        return fail(err, HG_E_UNSUPPORTED, format, OIIO::geterror());
    if (!output->open(std::string("memory.") + format, make_spec(image, params)))
        return fail(err, HG_E_IO, format, output->geterror());
    if (write_pixels(*output, image, params) || !output->close())
        return fail(err, HG_E_IO, format, output->geterror());
    hg_write_bytes(out, bytes.data(), bytes.size());
    return out->failed ? fail(err, HG_E_NOMEM, format, "no room for the file") : HG_OK;
}

} // namespace

hg_status hg_oiio_probe(const void *data, size_t size, const char *name, const char *format,
    hg_image_info *out, hg_error *err)
{
    return guarded(name, err, [&]() -> hg_status {
        Source source(data, size);
        hg_status st = open_source(source, name, format, err);
        if (st)
            return st;
        const ImageSpec &s = source.spec;
        out->width = uint32_t(s.width);
        out->height = uint32_t(s.height);
        out->channels = uint32_t(s.nchannels);
        out->is_float = s.format.is_floating_point();
        out->is_16bit = s.format.size() == 2;
        snprintf(out->file_format, sizeof out->file_format, "%s", format);
        return HG_OK;
    });
}

hg_status hg_oiio_read(const void *data, size_t size, const char *name, const char *format,
    hg_pixel_format pixels, const hg_image_limits *limits, hg_image *out, hg_error *err)
{
    hg_status st = guarded(name, err, [&]() -> hg_status {
        Source source(data, size);
        hg_status opened = open_source(source, name, format, err);
        return opened ? opened : read_image(source, name, pixels, *limits, out, err);
    });
    if (st)
        hg_image_finish(out);
    return st;
}

hg_status hg_oiio_encode(
    const hg_image *image, const struct hg_image_encode *params, hg_writer *out, hg_error *err)
{
    return guarded("image", err, [&] { return encode(image, params, out, err); });
}
