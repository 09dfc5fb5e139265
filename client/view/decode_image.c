#include "client/view/decode_image.h"

#include <turbojpeg.h>

enum hg_status hg_view_decode_fail(struct hg_error *err, enum hg_status status, const char *reason)
{
    return hg_error_set(err, status, "frame", "data", "%s", reason);
}

static enum hg_status decode(void **jpeg, const struct hgp_bytes *file,
    const struct hg_view_area *area, struct hg_error *err)
{
    int width, height, sampling, space;
    if (!*jpeg)
        *jpeg = tjInitDecompress();
    if (!*jpeg)
        return hg_view_decode_fail(err, HG_E_NOMEM, "no memory for JPEG");
    // The header first: the picture must not be larger than the room for it.
    if (tjDecompressHeader3(*jpeg, file->data, file->size, &width, &height, &sampling, &space))
        return hg_view_decode_fail(err, HG_E_FORMAT, tjGetErrorStr2(*jpeg));
    if (width != (int)area->width || height != (int)area->height)
        return hg_view_decode_fail(err, HG_E_FORMAT, "a JPEG of another size");
    if (tjDecompress2(*jpeg, file->data, file->size, area->pixels, width, (int)area->pitch, height,
            TJPF_RGBA, 0) &&
        tjGetErrorCode(*jpeg) == TJERR_FATAL)
        return hg_view_decode_fail(err, HG_E_FORMAT, tjGetErrorStr2(*jpeg));
    return HG_OK;
}

// Tables of a damaged file would be those of files after it.
enum hg_status hg_view_decode_jpeg(void **jpeg, const struct hgp_bytes *file,
    const struct hg_view_area *area, struct hg_error *err)
{
    const enum hg_status status = decode(jpeg, file, area, err);
    if (status && *jpeg) {
        tjDestroy(*jpeg);
        *jpeg = NULL;
    }
    return status;
}
