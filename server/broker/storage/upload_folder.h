// upload_folder.h - the files of uploaded contents: <folder>/<hex> is a content, <folder>/<key>/
// has a link to each that an owner has sent, <folder>/.incoming.<n> is one that still arrives.
// Floor 6 (broker). Thread: any; a lock says where owners' folders are. All of it may wait for the
// disk.
#ifndef HG_BROKER_UPLOAD_FOLDER_H
#define HG_BROKER_UPLOAD_FOLDER_H

#include <limits.h>
#include <pthread.h>
#include <stddef.h>
#include <stdint.h>

#include "base/sha256.h"
#include "base/status.h"

enum {
    HG_UPLOAD_KEY_DIGITS = 32, // of an owner's key, the name of its folder
    HG_UPLOAD_PATH = PATH_MAX + HG_SHA256_HEX
};

struct hg_upload_folder {
    char *path;
    pthread_mutex_t lock; // of `moved` of all places, and of what is done below them
};

// Where an owner's links are. They are there so that later runs know whose contents are, and a
// worker may be shown those of its tenant and no others.
struct hg_upload_place {
    uint8_t key[32];
    char *moved; // NULL = in the folder of contents
};

void hg_upload_folder_content(
    const struct hg_upload_folder *folder, const uint8_t hash[32], char path[HG_UPLOAD_PATH]);
void hg_upload_folder_incoming(
    const struct hg_upload_folder *folder, uint32_t number, char path[HG_UPLOAD_PATH]);
// Of the thread that moves places.
const char *hg_upload_folder_place(const struct hg_upload_folder *folder,
    const struct hg_upload_place *place, char path[HG_UPLOAD_PATH]);

// Moves an owner's folder; NULL: back. HG_E_NOMEM, HG_E_PERM, HG_E_IO.
enum hg_status hg_upload_folder_move(struct hg_upload_folder *folder, struct hg_upload_place *place,
    const char *to, struct hg_error *err) HG_MUST_CHECK;
// It is there already. Takes over the text.
void hg_upload_folder_moved(
    struct hg_upload_folder *folder, struct hg_upload_place *place, char *to);
// A link of an owner to a content; one that is there is fine. HG_E_NOSPACE, HG_E_IO, ...
enum hg_status hg_upload_folder_link(struct hg_upload_folder *folder,
    const struct hg_upload_place *place, const uint8_t hash[32]) HG_MUST_CHECK;
// Removes a content, or the link of an owner to it.
void hg_upload_folder_unlink(
    struct hg_upload_folder *folder, const struct hg_upload_place *place, const uint8_t hash[32]);

#endif
