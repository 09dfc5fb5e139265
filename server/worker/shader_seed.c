#include "server/worker/shader_seed.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/sendfile.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/log.h"

// ---- copies -------------------------------------------------------------------------------------

enum { DEPTH_MAX = 4 };

// Files of the driver appear under their name when they are whole, and so do these.
static bool copy_file(int from, int to, const char *name)
{
    char temporary[300];
    struct stat st;
    const int in = openat(from, name, O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
    snprintf(temporary, sizeof temporary, ".%s", name);
    const int out =
        in < 0 ? -1 : openat(to, temporary, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    bool ok = out >= 0 && fstat(in, &st) == 0 && S_ISREG(st.st_mode);
    for (off_t at = 0; ok && at < st.st_size;)
        ok = sendfile(out, in, &at, (size_t)(st.st_size - at)) > 0;
    ok = ok && renameat(to, temporary, to, name) == 0;
    if (out >= 0 && !ok)
        unlinkat(to, temporary, 0);
    if (out >= 0)
        close(out);
    if (in >= 0)
        close(in);
    return ok;
}

static int open_folder(int parent, const char *name)
{
    return openat(parent, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
}

// Takes both descriptors; returns how many files were copied.
static unsigned copy_tree(int from, int to, int depth)
{
    struct stat st;
    unsigned count = 0;
    DIR *dir = from < 0 || to < 0 ? NULL : fdopendir(from);
    if (!dir && from >= 0)
        close(from);
    for (struct dirent *it; dir && (it = readdir(dir));) {
        const char *name = it->d_name;
        if (name[0] == '.' || fstatat(from, name, &st, AT_SYMLINK_NOFOLLOW) != 0)
            continue;
        if (S_ISDIR(st.st_mode) && depth < DEPTH_MAX &&
            (mkdirat(to, name, 0700) == 0 || errno == EEXIST))
            count += copy_tree(open_folder(from, name), open_folder(to, name), depth + 1);
        else if (S_ISREG(st.st_mode) && faccessat(to, name, F_OK, AT_SYMLINK_NOFOLLOW) != 0)
            count += copy_file(from, to, name);
    }
    if (dir)
        closedir(dir);
    if (to >= 0)
        close(to);
    return count;
}

void hg_shader_seed_copy(const char *seed, const char *cache_dir)
{
    char path[4096];
    if ((size_t)snprintf(path, sizeof path, "%s/shaders", cache_dir) >= sizeof path)
        return;
    if (mkdir(path, 0700) != 0 && errno != EEXIST)
        hg_debug(WORKER, "%s: %s", path, strerror(errno));
    const unsigned count = copy_tree(open_folder(AT_FDCWD, seed), open_folder(AT_FDCWD, path), 0);
    hg_debug(WORKER, "%u compiled shaders copied", count);
}

// ---- making them --------------------------------------------------------------------------------

enum { WIDTH = 320, HEIGHT = 180 };

// How a view is looked at: in motion for some steps, then at rest.
static const struct way {
    struct hg_view_params params;
    uint32_t moving, still;
    bool final; // only the settled picture matters
} ways[] = {
    {.params = {.gi = HG_GI_AUTO, .reflections = HG_REFLECTIONS_AUTO, .temporal = HG_TEMPORAL_AUTO},
        .moving = 6,
        .still = 24},
    {.params = {.gi = HG_GI_AUTO, .reflections = HG_REFLECTIONS_AUTO, .samples = 2},
        .still = 100,
        .final = true},
    {.params = {.gi = HG_GI_NONE}, .moving = 2, .still = 4},
    {.params = {.mode = HG_MODE_PATH}, .still = 2},
};

static enum hg_status look(struct hg_view *view, const struct way *way, struct hg_error *err)
{
    struct hg_frame_info info = {0};
    enum hg_status status = HG_OK;
    hg_view_set_final(view, way->final);
    for (uint32_t i = 0; i < way->moving + way->still && !status && !info.settled; i++) {
        const float x = 0.05f * (float)(i < way->moving ? i : way->moving);
        const struct hg_view_camera camera = {.eye = {4 + x, 2.5f, 6}, .target = {x, 1, 0}};
        struct hg_refbuf *pixels = NULL;
        if (i <= way->moving)
            status = hg_view_set_camera(view, &camera, err);
        if (!status)
            status = hg_view_step(view, 1, &info, err);
        if (!status && hg_view_has_pixels(view, HG_PIXEL_RGBA8))
            status = hg_view_read_pixels(view, HG_PIXEL_RGBA8, &pixels, err);
        hg_refbuf_unref(pixels);
    }
    return status;
}

static enum hg_status show(struct hg_renderer *renderer, struct hg_scene *scene,
    const struct way *way, struct hg_error *err)
{
    struct hg_view *view;
    struct hg_view_params params = way->params;
    params.width = WIDTH;
    params.height = HEIGHT;
    enum hg_status status = hg_view_create(renderer, scene, &view, err);
    if (status)
        return status;
    status = hg_view_set_params(view, &params, err);
    if (!status)
        status = look(view, way, err);
    hg_view_destroy(view);
    return status;
}

static enum hg_status fill(
    struct hg_renderer *renderer, struct hg_scene *scene, bool has_sky, struct hg_error *err)
{
    const struct hg_load_params params = {
        .path = "demo:", .asset_number = 1, .scene_index = -1, .jobs = hg_renderer_jobs(renderer)};
    struct hg_asset *asset;
    enum hg_status status = hg_load_asset(&params, &asset, err);
    if (status)
        return status;
    status = hg_scene_add_asset(scene, asset, NULL);
    if (status) {
        hg_asset_destroy(asset);
        return status;
    }
    if (has_sky)
        hg_demo_environment(&scene->environment);
    scene->environment.revision = scene->revision + 1;
    hg_scene_publish(scene);
    return HG_OK;
}

// The built-in scene under its own sky, or under the light of scenes that bring none.
static enum hg_status show_all(struct hg_renderer *renderer, bool has_sky, struct hg_error *err)
{
    struct hg_scene *scene;
    enum hg_status status = hg_scene_create(&scene);
    if (status)
        return hg_error_set(err, status, "shaders", NULL, "no memory");
    status = fill(renderer, scene, has_sky, err);
    for (size_t i = 0; i < sizeof ways / sizeof *ways && !status; i++)
        status = show(renderer, scene, &ways[i], err);
    hg_scene_destroy(scene);
    return status;
}

enum hg_status hg_shader_seed_compile(const struct hg_renderer_params *params, struct hg_error *err)
{
    struct hg_renderer *renderer;
    enum hg_status status = hg_renderer_create(params, &renderer, err);
    if (status)
        return status;
    status = hg_renderer_warm_up(renderer, NULL, NULL, err);
    if (!status)
        status = show_all(renderer, false, err);
    if (!status)
        status = show_all(renderer, true, err);
    hg_renderer_destroy(renderer);
    return status;
}
