// recording.h - what a client sent to a server, when, and the pictures that it got when they were
// settled: a file that `helio run --replay` sends again. Floor 6 (client). One thread.
//
// The file: the 8 bytes "HGPREC\x1a\x01", then records {u8 kind, u64 time_ns, u32 size, bytes},
// little-endian; times count from the first record.
//   1 scene    u32 first_id, u32 id_count, then the scene's name: what follows is sent to it
//   2 sent     a message of the protocol with its header, channel 0
//   3 settled  u32 view, u64 input_seq, u64 revision, 32 bytes of hash: a settled frame came
// Frames are not in it, nor tokens. Uploads are.
#ifndef HG_CLIENT_CLI_RUN_RECORDING_H
#define HG_CLIENT_CLI_RUN_RECORDING_H

#include "client/include/helio/helio.h"

enum hg_record_kind { HG_RECORD_SCENE = 1, HG_RECORD_SENT = 2, HG_RECORD_SETTLED = 3 };

struct hg_record_settled {
    uint32_t view;
    uint64_t input_seq, revision;
    uint8_t hash[32];
};

struct hg_record {
    enum hg_record_kind kind;
    uint64_t time_ns;
    union {
        struct {
            uint32_t first_id, id_count;
            struct hgp_str name;
        } scene;
        struct {
            struct hgp_header header;
            const uint8_t *payload;
        } sent;
        struct hg_record_settled settled;
    };
};

// ---- writing -----------------------------------------------------------------------------------

struct hg_cli_recorder;

// The file appears when the recorder is finished. HG_E_INVAL, HG_E_PERM, HG_E_NOTFOUND: it cannot
// be made there.
enum hg_status hg_cli_recorder_create(
    const char *path, struct hg_cli_recorder **out, struct hg_error *err) HG_MUST_CHECK;
// Records what goes over this connection from here on, in the scene that is open.
enum hg_status hg_cli_recorder_attach(struct hg_cli_recorder *r, struct helio *h,
    const struct hgp_scene_opened *scene, const char *name, struct hg_error *err) HG_MUST_CHECK;
// Writes the file. Accepts NULL. The connections are not recorded any more.
enum hg_status hg_cli_recorder_finish(
    struct hg_cli_recorder *r, struct hg_error *err) HG_MUST_CHECK;

// ---- reading -----------------------------------------------------------------------------------

struct hg_recording {
    uint8_t *data; // heap
    size_t size, at;
    const char *path; // borrowed, for messages
};

// Reads the file and checks its first bytes. HG_E_NOTFOUND, HG_E_FORMAT, HG_E_LIMIT (above 1 GiB).
enum hg_status hg_recording_open(
    const char *path, struct hg_recording *out, struct hg_error *err) HG_MUST_CHECK;
// The next record, which borrows the file's bytes. HG_E_CLOSED: it was the last (err stays);
// HG_E_FORMAT with the byte where it is damaged.
enum hg_status hg_recording_next(
    struct hg_recording *r, struct hg_record *out, struct hg_error *err) HG_MUST_CHECK;
void hg_recording_rewind(struct hg_recording *r);
void hg_recording_close(struct hg_recording *r); // accepts a zeroed one

#endif
