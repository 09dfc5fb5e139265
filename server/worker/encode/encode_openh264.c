#include "server/worker/encode/encode_openh264.h"

#include <string.h>
#include <wels/codec_api.h>

#include "base/alloc.h"
#include "server/worker/encode/h264.h"
#include "server/worker/encode/yuv.h"

struct openh264 {
    ISVCEncoder *encoder;
    SEncParamExt params;
    struct hg_yuv yuv;
};

void hg_openh264_close(void *state)
{
    struct openh264 *s = state;
    if (s->encoder) {
        (*s->encoder)->Uninitialize(s->encoder);
        WelsDestroySVCEncoder(s->encoder);
    }
    hg_yuv_finish(&s->yuv);
    hg_free(s);
}

static void describe_colour(SSpatialLayerConfig *layer)
{
    layer->bVideoSignalTypePresent = true;
    layer->uiVideoFormat = VF_UNDEF;
    layer->bFullRange = false;
    layer->bColorDescriptionPresent = true;
    layer->uiColorPrimaries = CP_BT709;
    layer->uiTransferCharacteristics = TRC_IEC61966_2_1; // sRGB
    layer->uiColorMatrix = CM_BT709;
}

// Constant quantiser, which frames change; key frames on demand; references are the frame before.
static void fill_params(struct openh264 *s, const struct encode_request *first)
{
    SEncParamExt *p = &s->params;
    SSpatialLayerConfig *layer = &p->sSpatialLayers[0];
    (*s->encoder)->GetDefaultParams(s->encoder, p);
    p->iUsageType = CAMERA_VIDEO_REAL_TIME;
    p->iPicWidth = layer->iVideoWidth = (int)s->yuv.width;
    p->iPicHeight = layer->iVideoHeight = (int)s->yuv.height;
    p->fMaxFrameRate = layer->fFrameRate = 30;
    p->iTargetBitrate = layer->iSpatialBitrate = 5000000; // of no effect with RC_OFF_MODE
    p->iMaxBitrate = layer->iMaxSpatialBitrate = UNSPECIFIED_BIT_RATE;
    p->iRCMode = RC_OFF_MODE;
    p->iMinQp = 0;
    p->iMaxQp = 51;
    p->iSpatialLayerNum = p->iTemporalLayerNum = 1;
    p->iMultipleThreadIdc = 1;
    p->iNumRefFrame = 1;
    p->uiIntraPeriod = 0;
    p->iEntropyCodingModeFlag = 1;
    p->eSpsPpsIdStrategy = CONSTANT_ID;
    p->bEnableFrameSkip = p->bEnableSceneChangeDetect = p->bEnableAdaptiveQuant = false;
    p->bEnableBackgroundDetection = p->bEnableDenoise = p->bEnableLongTermReference = false;
    layer->uiProfileIdc = PRO_HIGH;
    layer->iDLayerQp = hg_h264_quantiser(first->quality);
    describe_colour(layer);
}

static bool start(struct openh264 *s, const struct encode_request *first)
{
    int quiet = WELS_LOG_QUIET;
    if (WelsCreateSVCEncoder(&s->encoder) != 0) {
        s->encoder = NULL;
        return false;
    }
    (*s->encoder)->SetOption(s->encoder, ENCODER_OPTION_TRACE_LEVEL, &quiet);
    fill_params(s, first);
    return (*s->encoder)->InitializeExt(s->encoder, &s->params) == cmResultSuccess;
}

enum hg_status hg_openh264_open(
    const struct encode_request *first, void **state, struct hg_error *err)
{
    const struct hgp_frame *f = &first->frame;
    struct openh264 *s = hg_calloc(1, sizeof *s);
    *state = NULL;
    if (!s || hg_yuv_create(f->width, f->height, HG_H264_LEAST_PX, false, &s->yuv)) {
        hg_free(s);
        return hg_error_set(err, HG_E_NOMEM, "openh264", NULL, "no memory");
    }
    if (!start(s, first)) {
        hg_openh264_close(s);
        return hg_error_set(err, HG_E_UNSUPPORTED, "openh264", "size",
            "the encoder does not take pictures of %ux%u px", f->width, f->height);
    }
    *state = s;
    return HG_OK;
}

static bool set_quality(struct openh264 *s, uint8_t quality)
{
    int *quantiser = &s->params.sSpatialLayers[0].iDLayerQp, wanted = hg_h264_quantiser(quality);
    if (*quantiser == wanted)
        return true;
    *quantiser = wanted;
    return (*s->encoder)->SetOption(s->encoder, ENCODER_OPTION_SVC_ENCODE_PARAM_EXT, &s->params) ==
           cmResultSuccess;
}

static void write_layers(const SFrameBSInfo *info, struct hg_writer *out)
{
    for (int i = 0; i < info->iLayerNum; i++) {
        const SLayerBSInfo *layer = &info->sLayerInfo[i];
        size_t size = 0;
        for (int n = 0; n < layer->iNalCount; n++)
            size += (size_t)layer->pNalLengthInByte[n];
        hg_write_bytes(out, layer->pBsBuf, size);
    }
}

enum hg_status hg_openh264_encode(void *state, const struct encode_request *request,
    struct encode_output *out, struct hg_error *err)
{
    struct openh264 *s = state;
    SFrameBSInfo info = {0};
    SSourcePicture picture = {.iColorFormat = videoFormatI420,
        .iPicWidth = (int)s->yuv.width,
        .iPicHeight = (int)s->yuv.height};
    hg_yuv_convert(&s->yuv, request->pixels->data, request->frame.width, request->frame.height);
    for (int i = 0; i < 3; i++) {
        picture.pData[i] = s->yuv.planes[i];
        picture.iStride[i] = (int)s->yuv.strides[i];
    }
    if (request->key_frame)
        (*s->encoder)->ForceIntraFrame(s->encoder, true);
    if (!set_quality(s, request->quality) ||
        (*s->encoder)->EncodeFrame(s->encoder, &picture, &info) != cmResultSuccess ||
        info.eFrameType == videoFrameTypeInvalid || info.eFrameType == videoFrameTypeSkip)
        return hg_error_set(err, HG_E_INTERNAL, "openh264", NULL, "the encoder failed");
    const size_t begin = out->data.size;
    write_layers(&info, &out->data);
    out->depends = info.eFrameType != videoFrameTypeIDR;
    if (!out->depends && !out->data.failed)
        hg_h264_codec(out->data.data + begin, out->data.size - begin, out->codec);
    return HG_OK;
}
