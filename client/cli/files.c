// files.c - which files an asset on this machine consists of, for uploads. Reads only the parts of
// glTF and OBJ/MTL that name other files; what is wrong with them is the loader's to say.
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/bytes.h"
#include "base/file.h"
#include "client/cli/cli.h"

enum { FILES_MAX = 4096 };

#define MAIN_FILE_BYTES (UINT64_C(1) << 30)

struct list {
    struct hg_cli_files files;
    size_t capacity;
    char folder[PATH_MAX]; // of the main file, with a slash at the end; or empty
};

static int hex_digit(char c)
{
    const char *digits = "0123456789abcdef";
    const char *at = c ? strchr(digits, c | 0x20) : NULL;
    return at ? (int)(at - digits) : -1;
}

// Percent-decoding of RFC 3986; malformed escapes stay as they are.
static void decode_uri(char *text)
{
    char *to = text;
    for (const char *from = text; *from; from++) {
        int high = *from == '%' ? hex_digit(from[1]) : -1;
        int low = high >= 0 ? hex_digit(from[2]) : -1;
        bool escaped = low >= 0 && (high || low);
        *to++ = (char)(escaped ? high * 16 + low : *from);
        from += escaped ? 2 : 0;
    }
    *to = 0;
}

static enum hg_status add_file(struct list *list, const char *path, const char *uri)
{
    struct hg_cli_files *files = &list->files;
    for (uint32_t i = 0; i < files->count; i++)
        if (strcmp(files->items[i].uri, uri) == 0)
            return HG_OK;
    if (files->count == FILES_MAX)
        return HG_E_LIMIT;
    if (hg_grow(&files->items, &list->capacity, files->count + 1, sizeof *files->items))
        return HG_E_NOMEM;
    char *path_copy = hg_strdup(path), *uri_copy = hg_strdup(uri);
    if (!path_copy || !uri_copy) {
        hg_free(path_copy);
        hg_free(uri_copy);
        return HG_E_NOMEM;
    }
    files->items[files->count++] = (struct helio_file){.path = path_copy, .uri = uri_copy};
    return HG_OK;
}

// As the loader looks for a texture that is not where the file says (renderer/scene): by its base
// name, beside the file and in textures/. True: there is one, and `name` is what the loader asks
// for.
static bool find_elsewhere(const struct list *list, char *name, size_t size)
{
    static const char *const folders[] = {"", "textures/"};
    char base[1014], other[1024], path[PATH_MAX + 1024];
    for (char *c = name; *c; c++)
        *c = *c == '\\' ? '/' : *c;
    const char *slash = strrchr(name, '/');
    if (strlen(slash ? slash + 1 : name) >= sizeof base)
        return false;
    snprintf(base, sizeof base, "%.1013s", slash ? slash + 1 : name);
    for (size_t i = 0; i < 2; i++) {
        snprintf(other, sizeof other, "%s%s", folders[i], base);
        snprintf(path, sizeof path, "%s%s", list->folder, other);
        if (access(path, R_OK) == 0) {
            snprintf(name, size, "%s", other);
            return true;
        }
    }
    return false;
}

static enum hg_status add_reference(struct list *list, const char *uri, bool decode)
{
    char name[1024], path[PATH_MAX + 1024];
    if (strncasecmp(uri, "data:", 5) == 0 || !*uri || strlen(uri) >= sizeof name)
        return HG_OK;
    snprintf(name, sizeof name, "%s", uri);
    if (decode)
        decode_uri(name);
    snprintf(path, sizeof path, "%s%s", name[0] == '/' ? "" : list->folder, name);
    if (!decode && access(path, R_OK) != 0 && find_elsewhere(list, name, sizeof name))
        snprintf(path, sizeof path, "%s%s", list->folder, name);
    return add_file(list, path, name);
}

static enum hg_status add_gltf(struct list *list, const char *json, size_t size)
{
    static const char *const kinds[] = {"buffers", "images"};
    json_error_t wrong;
    json_t *root = json_loadb(json, size, 0, &wrong);
    enum hg_status status = HG_OK;
    for (int k = 0; k < 2; k++) {
        size_t index;
        json_t *entry;
        json_array_foreach(json_object_get(root, kinds[k]), index, entry)
        {
            const char *uri = json_string_value(json_object_get(entry, "uri"));
            if (uri && !status)
                status = add_reference(list, uri, true);
        }
    }
    json_decref(root);
    return status;
}

// The JSON chunk of a GLB file.
static enum hg_status add_glb(struct list *list, const uint8_t *data, size_t size)
{
    struct hg_reader r = hg_reader_make(data, size);
    hg_read_bytes(&r, 12);
    uint32_t length = hg_read_u32(&r), type = hg_read_u32(&r);
    const uint8_t *json = hg_read_bytes(&r, length);
    return r.failed || type != 0x4e4f534a ? HG_OK : add_gltf(list, (const char *)json, length);
}

// The last word of every line that starts with one of the keywords.
static enum hg_status add_lines(struct list *list, char *text, const char *const *keywords)
{
    enum hg_status status = HG_OK;
    char *save = NULL;
    for (char *line = strtok_r(text, "\r\n", &save); line && !status;
         line = strtok_r(NULL, "\r\n", &save)) {
        line += strspn(line, " \t");
        for (const char *const *k = keywords; *k; k++) {
            size_t n = strlen(*k);
            if (strncasecmp(line, *k, n) != 0 || (line[n] != ' ' && line[n] != '\t'))
                continue;
            char *name = line + n + strspn(line + n, " \t");
            char *end = name + strlen(name);
            while (end > name && (end[-1] == ' ' || end[-1] == '\t'))
                *--end = 0;
            char *space = strcmp(*k, "mtllib") == 0 ? NULL : strrchr(name, ' ');
            status = add_reference(list, space ? space + 1 : name, false);
        }
    }
    return status;
}

static enum hg_status add_obj(struct list *list, char *text)
{
    static const char *const obj[] = {"mtllib", NULL};
    static const char *const mtl[] = {"map_Kd", "map_Ka", "map_Ks", "map_Ke", "map_d", "map_Bump",
        "bump", "norm", "map_Kn", "map_Pr", "map_Pm", "disp", NULL};
    enum hg_status status = add_lines(list, text, obj);
    uint32_t libraries = list->files.count;
    for (uint32_t i = 1; !status && i < libraries; i++) {
        uint8_t *data;
        size_t size;
        if (hg_file_read(list->files.items[i].path, MAIN_FILE_BYTES, &data, &size, NULL))
            continue; // the upload says what is missing
        status = add_lines(list, (char *)data, mtl);
        hg_free(data);
    }
    return status;
}

// Of formats that name other files, by the end of the name.
static enum hg_status add_references(struct list *list, const char *end, uint8_t *data, size_t size)
{
    if (strcasecmp(end, ".gltf") == 0)
        return add_gltf(list, (const char *)data, size);
    if (strcasecmp(end, ".glb") == 0)
        return add_glb(list, data, size);
    return strcasecmp(end, ".obj") == 0 ? add_obj(list, (char *)data) : HG_OK;
}

enum hg_status hg_cli_files_of_asset(
    const char *path, struct hg_cli_files *out, struct hg_error *err)
{
    struct list list = {0};
    uint8_t *data;
    size_t size;
    *out = (struct hg_cli_files){0};
    const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
    const char *dot = strrchr(name, '.');
    if ((size_t)(name - path) >= sizeof list.folder)
        return hg_error_set(err, HG_E_INVAL, path, NULL, "the name is too long");
    snprintf(list.folder, sizeof list.folder, "%.*s", (int)(name - path), path);
    enum hg_status status = hg_file_read(path, MAIN_FILE_BYTES, &data, &size, err);
    if (status)
        return status;
    status = add_file(&list, path, name);
    if (!status && dot)
        status = add_references(&list, dot, data, size);
    hg_free(data);
    if (status) {
        hg_cli_files_free(&list.files);
        return hg_error_set(err, status, path, NULL, "cannot list the files that it refers to: %s",
            hg_status_text(status));
    }
    *out = list.files;
    return HG_OK;
}

void hg_cli_files_free(struct hg_cli_files *files)
{
    for (uint32_t i = 0; i < files->count; i++) {
        hg_free((char *)(uintptr_t)files->items[i].path);
        hg_free((char *)(uintptr_t)files->items[i].uri);
    }
    hg_free(files->items);
    *files = (struct hg_cli_files){0};
}
