// oiio.cpp - the only caller of OpenImageIO, a module of its own that programs load when they need
// it: see oiio_module.h, and for the functions oiio.h, writer.h and texture_system.h.
#include <algorithm>
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
#include <OpenImageIO/texture.h>

// C lets a struct and a function share a name; C++ warns that one hides the other.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow"
extern "C" {
#include "renderer/image/oiio_module.h"
}
#pragma GCC diagnostic pop

namespace
{

using OIIO::ImageInput;
using OIIO::ImageOutput;
using OIIO::ImageSpec;
using OIIO::TypeDesc;

const hg_oiio_host *host;

constexpr int image_limit_mb = 2048;
constexpr int large_image_limit_mb = 1 << 18;

// Library-wide switches, once per process. Parallelism is above: images decode side by side.
void set_up_library()
{
    static std::once_flag once;
    std::call_once(once, [] {
        OIIO::attribute("debug", 0); // it prints nothing
        OIIO::attribute("threads", 1);
        OIIO::attribute("exr_threads", -1);
        OIIO::attribute("limits:imagesize_MB", image_limit_mb);
        OIIO::attribute("limits:channels", int(HG_OIIO_MAX_CHANNELS));
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
    return host->error_set(err, status, name, nullptr, "%s", one_line(reason).c_str());
}

// Runs `work`, which returns a status, and turns what it throws into one.
template <class Work> hg_status guarded(const char *name, hg_error *err, Work work) noexcept
{
    try {
        return work();
    } catch (const std::bad_alloc &) {
        return host->error_set(err, HG_E_NOMEM, name, nullptr, "no memory to decode or encode");
    } catch (const std::exception &e) {
        return host->error_set(err, HG_E_FORMAT, name, nullptr, "%s", e.what());
    } catch (...) {
        return host->error_set(err, HG_E_FORMAT, name, nullptr, "the image library failed");
    }
}

TypeDesc type_of(hg_oiio_type type)
{
    switch (type) {
    case HG_OIIO_U8:
        return TypeDesc::UINT8;
    case HG_OIIO_U16:
        return TypeDesc::UINT16;
    case HG_OIIO_U32:
        return TypeDesc::UINT32;
    case HG_OIIO_HALF:
        return TypeDesc::HALF;
    case HG_OIIO_F32:
        return TypeDesc::FLOAT;
    case HG_OIIO_NATIVE:
        break;
    }
    return TypeDesc::UNKNOWN;
}

hg_oiio_header header_of(const ImageSpec &s)
{
    hg_oiio_header h = {};
    h.width = s.width;
    h.height = s.height;
    h.tile_width = s.tile_width;
    h.tile_height = s.tile_height;
    h.channels = s.nchannels;
    h.alpha_channel = s.alpha_channel;
    h.is_float = s.format.is_floating_point();
    h.is_16bit = s.format.size() == 2;
    h.straight_alpha = s.get_int_attribute("oiio:UnassociatedAlpha", 0) != 0;
    h.pixel_bytes = s.pixel_bytes(true);
    h.row_bytes = s.scanline_bytes(true);
    h.image_bytes = s.image_bytes(true);
    return h;
}

} // namespace

// --- decoding

// The reader borrows the proxy, so the order of members matters. Only the library's own proxies
// will do: its JPEG reader looks inside them.
struct hg_oiio_input {
    std::string label; // of the file, for messages
    std::unique_ptr<OIIO::Filesystem::IOProxy> bytes;
    std::unique_ptr<ImageInput> input;
    ImageSpec spec;
    hg_oiio_header header = {};

    explicit hg_oiio_input(const hg_image_bytes &file)
        : label(file.name),
          bytes(new OIIO::Filesystem::IOMemReader(const_cast<void *>(file.data), file.size))
    {
    }

    hg_oiio_input(FILE *file, const char *name)
        : label(name), bytes(new OIIO::Filesystem::IOFile(file, OIIO::Filesystem::IOProxy::Read))
    {
    }

    const char *name() const
    {
        return label.c_str();
    }
};

namespace
{

hg_status open_input(hg_oiio_input &in, const char *format, hg_error *err)
{
    const char *name = in.name();
    set_up_library();
    in.input = ImageInput::create(format, false, nullptr, nullptr, "");
    if (!in.input)
        return fail(err, HG_E_UNSUPPORTED, name,
            std::string("this OpenImageIO cannot read ") + format + ": " + OIIO::geterror());
    ImageSpec config;
    config.attribute("oiio:UnassociatedAlpha", 1);
    if (!in.input->set_ioproxy(in.bytes.get()))
        return fail(err, HG_E_UNSUPPORTED, name,
            std::string("this OpenImageIO cannot read ") + format + " from memory");
    if (!in.input->open(std::string("memory.") + format, in.spec, config))
        return fail(err, HG_E_FORMAT, name, in.input->geterror());
    const ImageSpec &s = in.spec;
    if (s.width < 1 || s.height < 1 || s.depth > 1 || s.nchannels < 1)
        return fail(err, HG_E_FORMAT, name, "no pixels");
    in.header = header_of(s);
    return HG_OK;
}

// The library's own limit is meant for images that are read whole.
hg_status open_large_input(hg_oiio_input &in, const char *format, hg_error *err)
{
    static std::mutex lock;
    std::lock_guard<std::mutex> guard(lock);
    set_up_library();
    OIIO::attribute("limits:imagesize_MB", large_image_limit_mb);
    hg_status st = open_input(in, format, err);
    OIIO::attribute("limits:imagesize_MB", image_limit_mb);
    return st;
}

// The status of a call that returns false on failure.
hg_status read_status(hg_oiio_input &in, bool ok, hg_error *err)
{
    return ok ? HG_OK : fail(err, HG_E_FORMAT, in.name(), in.input->geterror());
}

} // namespace

hg_status hg_oiio_open(FILE *file, const hg_image_bytes *bytes, const char *format, bool large,
    hg_oiio_input **out, hg_error *err)
{
    *out = nullptr;
    hg_oiio_input *in = nullptr;
    hg_status st = guarded(bytes->name, err, [&]() -> hg_status {
        in = file ? new hg_oiio_input(file, bytes->name) : new hg_oiio_input(*bytes);
        return large ? open_large_input(*in, format, err) : open_input(*in, format, err);
    });
    if (st)
        hg_oiio_close(in);
    else
        *out = in;
    return st;
}

void hg_oiio_close(hg_oiio_input *in)
{
    (void)guarded("image", nullptr, [&]() -> hg_status {
        delete in;
        return HG_OK;
    });
}

const char *hg_oiio_name(const hg_oiio_input *in)
{
    return in->name();
}

const hg_oiio_header *hg_oiio_get_header(const hg_oiio_input *in)
{
    return &in->header;
}

hg_status hg_oiio_part_header(hg_oiio_input *in, int part, hg_oiio_header *out, hg_error *err)
{
    *out = {};
    return guarded(in->name(), err, [&]() -> hg_status {
        if (!in->input->seek_subimage(part, 0))
            return HG_E_NOTFOUND;
        *out = header_of(in->input->spec(part));
        return HG_OK;
    });
}

bool hg_oiio_mip_size(hg_oiio_input *in, uint32_t mip, uint32_t size_px[2])
{
    return guarded(in->name(), nullptr, [&]() -> hg_status {
        ImageSpec s = in->input->spec_dimensions(0, int(mip));
        size_px[0] = uint32_t(s.width);
        size_px[1] = uint32_t(s.height);
        return s.format == TypeDesc::UNKNOWN ? HG_E_NOTFOUND : HG_OK;
    }) == HG_OK;
}

hg_status hg_oiio_read_text(
    hg_oiio_input *in, const char *key, char *text, size_t size_bytes, hg_error *err)
{
    return guarded(in->name(), err, [&]() -> hg_status {
        snprintf(text, size_bytes, "%s", std::string(in->spec.get_string_attribute(key)).c_str());
        return HG_OK;
    });
}

hg_status hg_oiio_read_image(hg_oiio_input *in, int part, const hg_oiio_target *to, hg_error *err)
{
    return guarded(in->name(), err, [&] {
        return read_status(*in,
            in->input->read_image(part, 0, 0, to->channels, type_of(to->type), to->pixels), err);
    });
}

hg_status hg_oiio_read_rows(hg_oiio_input *in, int part, uint32_t y, uint32_t count,
    const hg_oiio_target *to, hg_error *err)
{
    return guarded(in->name(), err, [&] {
        int first = in->input->spec_dimensions(part).y + int(y);
        return read_status(*in,
            in->input->read_scanlines(part, 0, first, first + int(count), 0, 0, to->channels,
                type_of(to->type), to->pixels),
            err);
    });
}

hg_status hg_oiio_read_tiles(
    hg_oiio_input *in, const hg_image_rect *area, const hg_oiio_target *to, hg_error *err)
{
    return guarded(in->name(), err, [&] {
        int mip = int(area->mip), width = int(area->size[0]), height = int(area->size[1]);
        ImageSpec s = in->input->spec_dimensions(0, mip);
        int x = s.x + int(area->at[0]), y = s.y + int(area->at[1]);
        return read_status(*in,
            in->input->read_tiles(0, mip, x, x + width, y, y + height, 0, 1, 0, to->channels,
                type_of(to->type), to->pixels),
            err);
    });
}

// --- encoding

namespace
{

void add_attribute(ImageSpec &spec, const hg_image_attribute &a)
{
    switch (a.type) {
    case hg_image_attribute::HG_ATTR_STRING:
        spec.attribute(a.name, a.string);
        break;
    case hg_image_attribute::HG_ATTR_INT:
        spec.attribute(a.name, a.integer);
        break;
    case hg_image_attribute::HG_ATTR_COUNT: {
        const double count = a.count;
        spec.attribute(a.name, TypeDesc::DOUBLE, &count);
        break;
    }
    case hg_image_attribute::HG_ATTR_FLOAT:
        spec.attribute(a.name, a.floats[0]);
        break;
    case hg_image_attribute::HG_ATTR_RATIO: {
        const int ratio[2] = {a.integer, int(a.count)};
        spec.attribute(a.name, OIIO::TypeRational, ratio);
        break;
    }
    case hg_image_attribute::HG_ATTR_MAT4:
        spec.attribute(a.name, OIIO::TypeMatrix44, a.floats);
        break;
    }
}

void add_exr_defaults(ImageSpec &spec)
{
    static const float rec709[8] = {0.64f, 0.33f, 0.30f, 0.60f, 0.15f, 0.06f, 0.3127f, 0.3290f};
    spec.attribute("compression", "zip");
    spec.attribute("chromaticities", TypeDesc(TypeDesc::FLOAT, 8), rec709);
    // Else the writer puts the present time into the file (capDate), and the same picture would
    // give other bytes. It leaves out what it has no type for; an empty text it would write.
    static const unsigned long long none = 0;
    spec.attribute("DateTime", TypeDesc::UINT64, &none);
}

ImageSpec make_spec(const hg_oiio_encode &e)
{
    ImageSpec spec(int(e.width), int(e.height), int(e.channels), type_of(e.type));
    spec.x = int(e.x);
    spec.y = int(e.y);
    if (e.full_width > 0 && e.full_height > 0) {
        spec.full_width = int(e.full_width);
        spec.full_height = int(e.full_height);
    }
    for (uint32_t i = 0; e.channel_names && i < e.channels; i++)
        spec.channelnames[i] = e.channel_names[i];
    add_exr_defaults(spec);
    for (size_t i = 0; i < e.attribute_count; i++)
        add_attribute(spec, e.attributes[i]);
    return spec;
}

hg_status encode(const hg_oiio_encode &e, hg_writer *out, hg_error *err)
{
    set_up_library();
    std::vector<unsigned char> bytes;
    OIIO::Filesystem::IOVecOutput memory(bytes);
    std::unique_ptr<ImageOutput> output = ImageOutput::create(e.format);
    if (!output || !output->set_ioproxy(&memory))
        return fail(err, HG_E_UNSUPPORTED, e.format, OIIO::geterror());
    if (!output->open(std::string("memory.") + e.format, make_spec(e)))
        return fail(err, HG_E_IO, e.name, output->geterror());
    const auto stride = OIIO::stride_t(e.pixel_stride_bytes);
    if (!output->write_image(type_of(e.pixel_type), e.pixels, stride) || !output->close())
        return fail(err, HG_E_IO, e.name, output->geterror());
    host->write_bytes(out, bytes.data(), bytes.size());
    return HG_OK;
}

} // namespace

hg_status hg_oiio_encode_image(const hg_oiio_encode *image, hg_writer *out, hg_error *err)
{
    return guarded(image->name, err, [&] { return encode(*image, out, err); });
}

// --- files written piece by piece

struct hg_image_writer {
    std::unique_ptr<ImageOutput> output;
    ImageSpec spec;
    std::string path;
    uint32_t width = 0, height = 0, mip = 0;
    int next_row = 0;
};

namespace
{

hg_status fail_write(const hg_image_writer &w, hg_error *err)
{
    return fail(err, HG_E_IO, w.path.c_str(), w.output->geterror());
}

hg_status begin_file(hg_image_writer &w, const hg_image_writer_params &p, hg_error *err)
{
    set_up_library();
    w.path = p.path;
    w.width = p.width;
    w.height = p.height;
    w.spec = ImageSpec(int(p.width), int(p.height), int(p.channels), TypeDesc::UINT8);
    w.spec.tile_width = w.spec.tile_height = int(p.tile_px);
    w.spec.attribute("oiio:UnassociatedAlpha", 1);
    if (strcmp(p.format, "tiff") == 0)
        w.spec.attribute("compression", "zip");
    else
        w.spec.attribute("png:compressionLevel", 1);
    if (w.spec.image_bytes(true) > UINT64_C(2) << 30)
        w.spec.attribute("tiff:bigtiff", 1);
    if (p.tile_px) { // for programs that look for textures
        w.spec.attribute("textureformat", "Plain Texture");
        w.spec.attribute("wrapmodes", "periodic,periodic");
    }
    w.output = ImageOutput::create(p.format);
    if (!w.output)
        return fail(err, HG_E_UNSUPPORTED, p.path, OIIO::geterror());
    return w.output->open(w.path, w.spec) ? HG_OK : fail_write(w, err);
}

} // namespace

hg_status hg_image_writer_begin(
    const struct hg_image_writer_params *params, hg_image_writer **out, hg_error *err)
{
    *out = nullptr;
    hg_image_writer *writer = nullptr;
    hg_status st = guarded(params->path, err, [&]() -> hg_status {
        writer = new hg_image_writer;
        return begin_file(*writer, *params, err);
    });
    if (st)
        hg_image_writer_abort(writer);
    else
        *out = writer;
    return st;
}

hg_status hg_image_writer_rows(
    hg_image_writer *w, uint32_t count, const void *pixels, hg_error *err)
{
    return guarded(w->path.c_str(), err, [&]() -> hg_status {
        int first = w->next_row;
        w->next_row += int(count);
        return w->output->write_scanlines(first, w->next_row, 0, TypeDesc::UINT8, pixels)
                   ? HG_OK
                   : fail_write(*w, err);
    });
}

hg_status hg_image_writer_tile(
    hg_image_writer *w, uint32_t x, uint32_t y, const void *pixels, hg_error *err)
{
    return guarded(w->path.c_str(), err, [&]() -> hg_status {
        return w->output->write_tile(int(x), int(y), 0, TypeDesc::UINT8, pixels)
                   ? HG_OK
                   : fail_write(*w, err);
    });
}

hg_status hg_image_writer_next_mip(hg_image_writer *w, hg_error *err)
{
    return guarded(w->path.c_str(), err, [&]() -> hg_status {
        w->mip++;
        w->spec.width = w->spec.full_width = int(std::max(w->width >> w->mip, 1u));
        w->spec.height = w->spec.full_height = int(std::max(w->height >> w->mip, 1u));
        return w->output->open(w->path, w->spec, ImageOutput::AppendSubimage) ? HG_OK
                                                                              : fail_write(*w, err);
    });
}

hg_status hg_image_writer_end(hg_image_writer *w, hg_error *err)
{
    hg_status st = guarded(w->path.c_str(), err,
        [&]() -> hg_status { return w->output->close() ? HG_OK : fail_write(*w, err); });
    hg_image_writer_abort(w);
    return st;
}

void hg_image_writer_abort(hg_image_writer *w)
{
    (void)guarded("image", nullptr, [&]() -> hg_status {
        delete w;
        return HG_OK;
    });
}

// --- the library's texture system

struct hg_texture_system {
    decltype(OIIO::TextureSystem::create(false)) system; // a pointer, shared in later versions
    OIIO::TextureSystem::Perthread *thread;
    std::vector<OIIO::TextureSystem::TextureHandle *> handles;
    OIIO::TextureOpt options;
};

hg_status hg_texture_system_create(uint64_t memory_bytes, hg_texture_system **out, hg_error *err)
{
    *out = nullptr;
    return guarded("textures", err, [&]() -> hg_status {
        set_up_library();
        std::unique_ptr<hg_texture_system> t(new hg_texture_system);
        t->system = OIIO::TextureSystem::create(false);
        t->system->attribute("max_memory_MB", float(double(memory_bytes) / 1048576.0));
        t->system->attribute("max_open_files", 1000);
        t->thread = t->system->get_perthread_info();
        t->options.swrap = t->options.twrap = OIIO::TextureOpt::WrapPeriodic;
        t->options.mipmode = OIIO::TextureOpt::MipModeTrilinear;
        t->options.interpmode = OIIO::TextureOpt::InterpBilinear;
        *out = t.release();
        return HG_OK;
    });
}

void hg_texture_system_destroy(hg_texture_system *t)
{
    (void)guarded("textures", nullptr, [&]() -> hg_status {
        if (t)
            OIIO::TextureSystem::destroy(t->system, true);
        delete t;
        return HG_OK;
    });
}

hg_status hg_texture_system_add(hg_texture_system *t, const char *path, hg_error *err)
{
    return guarded(path, err, [&]() -> hg_status {
        auto *handle = t->system->get_texture_handle(OIIO::ustring(path), t->thread);
        if (!handle || !t->system->good(handle))
            return fail(err, HG_E_IO, path, t->system->geterror());
        t->handles.push_back(handle);
        return HG_OK;
    });
}

bool hg_texture_system_sample(
    hg_texture_system *t, uint32_t texture, float u, float v, float footprint, float rgba[4])
{
    return guarded("textures", nullptr, [&]() -> hg_status {
        return t->system->texture(t->handles[texture], t->thread, t->options, u, v, footprint, 0, 0,
                   footprint, 4, rgba)
                   ? HG_OK
                   : HG_E_IO;
    }) == HG_OK;
}

uint64_t hg_texture_system_decoded_bytes(const hg_texture_system *t)
{
    long long bytes = 0;
    t->system->getattribute("stat:bytes_read", TypeDesc::INT64, &bytes);
    return uint64_t(bytes);
}

const char *hg_texture_system_version(void)
{
    return "OpenImageIO " OIIO_VERSION_STRING;
}

// --- the module

extern "C" __attribute__((visibility("default"))) hg_oiio_attach_fn hg_oiio_attach;

const hg_oiio_functions *hg_oiio_attach(const hg_oiio_host *program, size_t size_bytes)
{
    static const hg_oiio_functions functions = {hg_oiio_open, hg_oiio_close, hg_oiio_name,
        hg_oiio_get_header, hg_oiio_part_header, hg_oiio_mip_size, hg_oiio_read_text,
        hg_oiio_read_image, hg_oiio_read_rows, hg_oiio_read_tiles, hg_oiio_encode_image,
        hg_image_writer_begin, hg_image_writer_rows, hg_image_writer_tile, hg_image_writer_next_mip,
        hg_image_writer_end, hg_image_writer_abort, hg_texture_system_create,
        hg_texture_system_destroy, hg_texture_system_add, hg_texture_system_sample,
        hg_texture_system_decoded_bytes, hg_texture_system_version};
    host = program;
    return size_bytes == sizeof functions ? &functions : nullptr;
}
