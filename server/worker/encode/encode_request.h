// encode_request.h - a frame on its way to an encoder: pixels, planes, and what its file says.
// Floor 6, private to server/worker. Owned by one thread at a time.
#ifndef HG_SERVER_WORKER_ENCODE_ENCODE_REQUEST_H
#define HG_SERVER_WORKER_ENCODE_ENCODE_REQUEST_H

#include "base/bytes.h"
#include "renderer/renderer.h"
#include "server/worker/encode/encode_depth.h"
#include "server/worker/reply.h"

// What a file says besides its pixels.
struct frame_metadata {
    char device[128];
    struct hg_view_params params;
    double time_s;                     // the scene's pose
    uint32_t rate[2];                  // frames per second as a ratio; 0 = not said
    float lens_radius, focus_distance; // metres; radius 0 = all is sharp
    float world_to_camera[16], world_to_ndc[16];
    char frame_key[65];  // hexadecimal, or empty
    char scene_hash[65]; // with a frame key: of what the scene holds
};

enum { ENCODE_MAX_PLANES = 40, ENCODE_MATTES = 3 };

struct encode_request {
    struct encode_request *next; // in its stream
    struct reply_to to;
    struct hgp_frame frame; // without data, hash and stages
    uint8_t quality;
    bool opaque;
    bool is_legend;   // a debug view
    bool parts;       // the data may go in parts
    bool key_frame;   // may depend on none before it
    uint64_t due_ns;  // when the view's next frame is to follow; 0 = when there is time
    uint32_t bitrate; // bit/s that frames with loss may take, 0 = by quality alone
    struct hg_refbuf *pixels;
    struct hg_frame_info info;
    uint64_t read_ns;
    struct frame_metadata metadata;
    struct encode_plane {
        enum hg_plane plane;
        char name[32];            // of the part; "": the plane's
        struct hg_refbuf *values; // floats
    } planes[ENCODE_MAX_PLANES];  // EXR only
    uint32_t plane_count;
    struct hg_matte mattes[ENCODE_MATTES]; // by kind; without ranks: not requested
    struct hg_depth_grid *depth;           // for reprojection; NULL: not wanted
};

enum { ENCODER_CODEC_BYTES = 33 };

// What becomes of a request.
struct encode_output {
    struct hg_writer data;           // none: the pixels are sent as they are
    struct hg_writer depth;          // of the frame, if wanted
    bool depends;                    // on the frame before of the same state
    bool lossy;                      // of an encoder that is `lossless` at other times
    char codec[ENCODER_CODEC_BYTES]; // video, key frames: RFC 6381
};

// Key of the text attribute that holds the hash of what a file was made from.
#define ENCODE_FRAME_KEY_ATTRIBUTE "heliograph:job"

void hg_encode_request_destroy(struct encode_request *request); // accepts NULL

#endif
