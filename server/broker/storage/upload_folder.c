#include "server/broker/storage/upload_folder.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/file.h"

void hg_upload_folder_content(
    const struct hg_upload_folder *folder, const uint8_t hash[32], char path[HG_UPLOAD_PATH])
{
    char hex[HG_SHA256_HEX];
    hg_sha256_hex(hash, hex);
    snprintf(path, HG_UPLOAD_PATH, "%s/%s", folder->path, hex);
}

void hg_upload_folder_incoming(
    const struct hg_upload_folder *folder, uint32_t number, char path[HG_UPLOAD_PATH])
{
    snprintf(path, HG_UPLOAD_PATH, "%s/.incoming.%u", folder->path, number);
}

const char *hg_upload_folder_place(const struct hg_upload_folder *folder,
    const struct hg_upload_place *place, char path[HG_UPLOAD_PATH])
{
    char hex[HG_SHA256_HEX];
    if (place->moved)
        return place->moved;
    hg_sha256_hex(place->key, hex);
    snprintf(path, HG_UPLOAD_PATH, "%s/%.*s", folder->path, HG_UPLOAD_KEY_DIGITS, hex);
    return path;
}

static void link_path(const struct hg_upload_folder *folder, const struct hg_upload_place *place,
    const uint8_t hash[32], char path[HG_UPLOAD_PATH])
{
    char hex[HG_SHA256_HEX], owner[HG_UPLOAD_PATH];
    hg_sha256_hex(hash, hex);
    snprintf(path, HG_UPLOAD_PATH, "%.*s/%s", PATH_MAX - 1,
        hg_upload_folder_place(folder, place, owner), hex);
}

enum hg_status hg_upload_folder_move(struct hg_upload_folder *folder, struct hg_upload_place *place,
    const char *to, struct hg_error *err)
{
    char here[HG_UPLOAD_PATH], there[HG_UPLOAD_PATH];
    struct hg_upload_place next = *place;
    next.moved = to ? hg_strdup(to) : NULL;
    if (to && !next.moved)
        return hg_error_set(err, HG_E_NOMEM, to, NULL, "no memory");
    const char *from = hg_upload_folder_place(folder, place, here);
    pthread_mutex_lock(&folder->lock);
    const int e = rename(from, hg_upload_folder_place(folder, &next, there)) == 0 ? 0 : errno;
    const bool moved = !e || e == ENOENT; // what it has not sent anything to has no folder
    char *gone = moved ? place->moved : next.moved;
    if (moved)
        place->moved = next.moved;
    pthread_mutex_unlock(&folder->lock);
    if (!moved)
        hg_error_set(
            err, hg_status_from_errno(e), from, NULL, "cannot move the folder: %s", strerror(e));
    hg_free(gone);
    return moved ? HG_OK : hg_status_from_errno(e);
}

void hg_upload_folder_moved(
    struct hg_upload_folder *folder, struct hg_upload_place *place, char *to)
{
    pthread_mutex_lock(&folder->lock);
    hg_free(place->moved);
    place->moved = to;
    pthread_mutex_unlock(&folder->lock);
}

enum hg_status hg_upload_folder_link(
    struct hg_upload_folder *folder, const struct hg_upload_place *place, const uint8_t hash[32])
{
    char from[HG_UPLOAD_PATH], to[HG_UPLOAD_PATH], owner[HG_UPLOAD_PATH];
    enum hg_status status = HG_OK;
    hg_upload_folder_content(folder, hash, from);
    pthread_mutex_lock(&folder->lock);
    if (mkdir(hg_upload_folder_place(folder, place, owner), 0700) != 0 && errno != EEXIST)
        status = hg_status_from_errno(errno);
    link_path(folder, place, hash, to);
    if (!status && link(from, to) != 0 && errno != EEXIST)
        status = hg_status_from_errno(errno);
    pthread_mutex_unlock(&folder->lock);
    return status;
}

void hg_upload_folder_unlink(
    struct hg_upload_folder *folder, const struct hg_upload_place *place, const uint8_t hash[32])
{
    char path[HG_UPLOAD_PATH];
    if (!place) {
        hg_upload_folder_content(folder, hash, path);
        unlink(path);
        return;
    }
    pthread_mutex_lock(&folder->lock);
    link_path(folder, place, hash, path);
    unlink(path);
    pthread_mutex_unlock(&folder->lock);
}
