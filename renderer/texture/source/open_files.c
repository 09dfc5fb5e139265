#include "renderer/texture/source/open_files.h"

#include <pthread.h>
#include <sys/resource.h>

#include "base/alloc.h"

struct hg_open_file {
    struct hg_open_files *files;
    struct hg_image_reader *reader;
    enum hg_pixel_format format;
    struct hg_open_file *newer, *older; // of those that are open
    uint32_t users;                     // who must not lose it
    bool open;                          // and in the list; bytes in memory never are
};

struct hg_open_files {
    pthread_mutex_t lock;
    struct hg_open_file *newest, *oldest;
    struct hg_open_files_stats stats;
};

static uint32_t default_most(void)
{
    struct rlimit files;
    if (getrlimit(RLIMIT_NOFILE, &files) != 0 || files.rlim_cur > 4096)
        return 1024;
    return files.rlim_cur < 32 ? 8 : (uint32_t)files.rlim_cur / 4;
}

enum hg_status hg_open_files_create(uint32_t most, struct hg_open_files **out)
{
    struct hg_open_files *f = hg_calloc(1, sizeof *f);
    *out = f;
    if (f == NULL)
        return HG_E_NOMEM;
    f->stats.most = most > 0 ? most : default_most();
    pthread_mutex_init(&f->lock, NULL);
    return HG_OK;
}

void hg_open_files_destroy(struct hg_open_files *f)
{
    if (f == NULL)
        return;
    pthread_mutex_destroy(&f->lock);
    hg_free(f);
}

// --- the list (the lock is held) -----------------------------------------------------------------

static void unlink_open(struct hg_open_file *file)
{
    struct hg_open_files *f = file->files;
    *(file->newer != NULL ? &file->newer->older : &f->newest) = file->older;
    *(file->older != NULL ? &file->older->newer : &f->oldest) = file->newer;
    file->newer = file->older = NULL;
    file->open = false;
    f->stats.open--;
}

static void link_open(struct hg_open_file *file)
{
    struct hg_open_files *f = file->files;
    file->older = f->newest;
    *(f->newest != NULL ? &f->newest->newer : &f->oldest) = file;
    f->newest = file;
    file->open = true;
    f->stats.open++;
}

// Closes files that are not being read, least recently used first, until at most `most` are open.
static void close_oldest(struct hg_open_files *f, uint32_t most)
{
    struct hg_open_file *next;
    for (struct hg_open_file *file = f->oldest; file != NULL && f->stats.open > most; file = next) {
        next = file->newer;
        if (file->users > 0)
            continue;
        unlink_open(file);
        hg_image_reader_sleep(file->reader);
    }
}

// --- files ---------------------------------------------------------------------------------------

void hg_open_files_give_up(struct hg_open_files *f)
{
    pthread_mutex_lock(&f->lock);
    close_oldest(f, f->stats.open / 2);
    pthread_mutex_unlock(&f->lock);
}

enum hg_status hg_open_files_add(struct hg_open_files *f, struct hg_image_reader *reader,
    enum hg_pixel_format format, struct hg_open_file **out)
{
    struct hg_open_file *file = hg_calloc(1, sizeof *file);
    *out = file;
    if (file == NULL) {
        hg_image_reader_close(reader);
        return HG_E_NOMEM;
    }
    *file = (struct hg_open_file){.files = f, .reader = reader, .format = format};
    pthread_mutex_lock(&f->lock);
    if (hg_image_reader_can_sleep(reader)) {
        link_open(file);
        close_oldest(f, f->stats.most);
    }
    pthread_mutex_unlock(&f->lock);
    return HG_OK;
}

void hg_open_file_remove(struct hg_open_file *file)
{
    if (file == NULL)
        return;
    struct hg_open_files *f = file->files;
    pthread_mutex_lock(&f->lock);
    if (file->open)
        unlink_open(file);
    pthread_mutex_unlock(&f->lock);
    hg_image_reader_close(file->reader);
    hg_free(file);
}

const struct hg_image_reader_info *hg_open_file_info(const struct hg_open_file *file)
{
    return hg_image_reader_info(file->reader);
}

enum hg_pixel_format hg_open_file_format(const struct hg_open_file *file)
{
    return file->format;
}

// The lock is held.
static enum hg_status wake(struct hg_open_file *file, struct hg_error *err)
{
    struct hg_open_files *f = file->files;
    enum hg_status status = hg_image_reader_wake(file->reader, err);
    if (status == HG_E_NOMEM) {
        close_oldest(f, f->stats.open / 2);
        status = hg_image_reader_wake(file->reader, err);
    }
    f->stats.reopened += status == HG_OK;
    return status;
}

// Until the matching release the file stays open.
static enum hg_status acquire(struct hg_open_file *file, struct hg_error *err)
{
    struct hg_open_files *f = file->files;
    enum hg_status status = HG_OK;
    pthread_mutex_lock(&f->lock);
    if (file->open)
        unlink_open(file);
    else if (hg_image_reader_can_sleep(file->reader))
        status = wake(file, err);
    file->users += status == HG_OK;
    if (status == HG_OK && hg_image_reader_can_sleep(file->reader))
        link_open(file);
    close_oldest(f, f->stats.most);
    pthread_mutex_unlock(&f->lock);
    return status;
}

static void release(struct hg_open_file *file)
{
    pthread_mutex_lock(&file->files->lock);
    file->users--;
    close_oldest(file->files, file->files->stats.most);
    pthread_mutex_unlock(&file->files->lock);
}

enum hg_status hg_open_file_rect(struct hg_open_file *file, const struct hg_image_rect *rect,
    void *pixels, uint64_t *bytes, struct hg_error *err)
{
    *bytes = 0;
    enum hg_status status = acquire(file, err);
    if (status != HG_OK)
        return status;
    status = hg_image_reader_rect(file->reader, rect, file->format, pixels, bytes, err);
    release(file);
    return status;
}

bool hg_open_file_is_unchanged(struct hg_open_file *file)
{
    pthread_mutex_lock(&file->files->lock);
    const bool same = hg_image_reader_is_unchanged(file->reader);
    pthread_mutex_unlock(&file->files->lock);
    return same;
}

void hg_open_files_stats(struct hg_open_files *f, struct hg_open_files_stats *out)
{
    pthread_mutex_lock(&f->lock);
    *out = f->stats;
    pthread_mutex_unlock(&f->lock);
}
