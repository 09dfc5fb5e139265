// image_exr_read.cpp - see image_exr.h.
#include "tests/unit/image_exr.h"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

using OIIO::TypeDesc;

static bool read_part(OIIO::ImageInput &in, int part, exr_seen *out)
{
    const OIIO::ImageSpec s = in.spec();
    TypeDesc type = s.format == TypeDesc::UINT32 ? TypeDesc::UINT32 : TypeDesc::FLOAT;
    *out = exr_seen();
    snprintf(out->name, sizeof out->name, "%s",
        std::string(s.get_string_attribute("oiio:subimagename")).c_str());
    snprintf(out->type, sizeof out->type, "%s", s.format.c_str());
    snprintf(out->channel, sizeof out->channel, "%s", s.channelnames[0].c_str());
    out->width = s.width;
    out->height = s.height;
    out->channels = s.nchannels;
    const OIIO::ParamValue *seed = s.find_attribute("heliograph:seed", TypeDesc::DOUBLE);
    out->seed = seed ? seed->get<double>() : -1;
    out->pixels = malloc(s.image_pixels() * size_t(s.nchannels) * 4);
    const OIIO::ParamValue *m = s.find_attribute("worldtocamera", OIIO::TypeMatrix44);
    if (m)
        memcpy(out->world_to_camera, m->data(), sizeof out->world_to_camera);
    return in.read_image(part, 0, 0, s.nchannels, type, out->pixels);
}

int exr_read(const void *data, size_t size, exr_seen *parts, int max)
{
    OIIO::Filesystem::IOMemReader bytes(const_cast<void *>(data), size);
    auto in = OIIO::ImageInput::create("openexr", false, nullptr, nullptr, "");
    OIIO::ImageSpec spec;
    if (!in || !in->set_ioproxy(&bytes) || !in->open("memory.exr", spec)) {
        fprintf(stderr, "exr: %s\n", in ? in->geterror().c_str() : "no reader");
        return -1;
    }
    int count = 0;
    for (; in->seek_subimage(count, 0); count++)
        if (count >= max || !read_part(*in, count, &parts[count])) {
            fprintf(stderr, "exr: part %d: %s\n", count, in->geterror().c_str());
            return -1;
        }
    return count;
}
