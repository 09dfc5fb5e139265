// compile.c - GLSL to SPIR-V at run time, for people who work on shaders (--shader-dir).
//
// Includes are expanded here, each file once per shader, with #line directives that carry file
// names: glslang 12 has no include callbacks in its C interface, and messages then name file and
// line with every version.
#include <glslang/Include/glslang_c_interface.h>
#include <glslang/Public/resource_limits_c.h>

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/bytes.h"
#include "base/file.h"
#include "base/log.h"
#include "renderer/gpu/internal.h"

#define MAX_FILES 64
#define MAX_DEPTH 16
#define MAX_BYTES (1u << 20)

struct expansion {
    const char *root;
    struct hg_writer text;
    char names[MAX_FILES][128];
    uint32_t count;
    struct hg_error *err;
};

static void put(struct expansion *e, const char *text, size_t size)
{
    hg_write_bytes(&e->text, text, size);
}

static void put_line_marker(struct expansion *e, uint32_t line, const char *name)
{
    char marker[192];
    const int size = snprintf(marker, sizeof marker, "#line %u \"%s\"\n", line, name);
    put(e, marker, (size_t)size);
}

static bool seen(struct expansion *e, const char *name)
{
    for (uint32_t i = 0; i < e->count; i++) {
        if (strcmp(e->names[i], name) == 0)
            return true;
    }
    return false;
}

// The name between the quotes of an #include line, or false.
static bool include_name(const char *line, size_t size, char *name, size_t name_size)
{
    char copy[256];
    if (size >= sizeof copy)
        return false;
    memcpy(copy, line, size);
    copy[size] = '\0';
    const char *p = copy + strspn(copy, " \t");
    if (*p++ != '#')
        return false;
    p += strspn(p, " \t");
    if (strncmp(p, "include", 7) != 0)
        return false;
    const char *open = strchr(p, '"'), *close = open != NULL ? strchr(open + 1, '"') : NULL;
    if (close == NULL || (size_t)(close - open - 1) >= name_size)
        return false;
    memcpy(name, open + 1, (size_t)(close - open - 1));
    name[close - open - 1] = '\0';
    return true;
}

static enum hg_status expand(struct expansion *e, const char *name, uint32_t depth);

static enum hg_status expand_lines(
    struct expansion *e, const char *name, const char *text, size_t size, uint32_t depth)
{
    uint32_t line = 1;
    for (size_t pos = 0; pos < size; line++) {
        const char *end = memchr(text + pos, '\n', size - pos);
        const size_t length = end != NULL ? (size_t)(end - text) - pos + 1 : size - pos;
        char included[128];
        if (!include_name(text + pos, length, included, sizeof included)) {
            put(e, text + pos, length);
        } else {
            enum hg_status status = seen(e, included) ? HG_OK : expand(e, included, depth + 1);
            if (status != HG_OK)
                return status;
            put_line_marker(e, line + 1, name);
        }
        pos += length;
    }
    put(e, "\n", 1);
    return e->text.failed ? HG_E_NOMEM : HG_OK;
}

static enum hg_status expand(struct expansion *e, const char *name, uint32_t depth)
{
    char path[4096];
    uint8_t *data;
    size_t size;
    if (depth > MAX_DEPTH || e->count == MAX_FILES || strlen(name) >= sizeof e->names[0] ||
        strstr(name, "..") != NULL)
        return hg_error_set(e->err, HG_E_FORMAT, name, NULL, "include is refused");
    if (snprintf(path, sizeof path, "%s/%s", e->root, name) >= (int)sizeof path)
        return hg_error_set(e->err, HG_E_INVAL, name, NULL, "path is too long");
    enum hg_status status = hg_file_read(path, MAX_BYTES, &data, &size, e->err);
    if (status != HG_OK)
        return status;
    memcpy(e->names[e->count++], name, strlen(name) + 1);
    if (depth > 0)
        put_line_marker(e, 1, name);
    status = expand_lines(e, name, (const char *)data, size, depth);
    hg_free(data);
    return status;
}

// --- glslang -------------------------------------------------------------------------------------

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;

static glslang_stage_t stage_of(const char *name)
{
    const char *dot = strrchr(name, '.');
    if (dot != NULL && strcmp(dot, ".vert") == 0)
        return GLSLANG_STAGE_VERTEX;
    if (dot != NULL && strcmp(dot, ".frag") == 0)
        return GLSLANG_STAGE_FRAGMENT;
    return GLSLANG_STAGE_COMPUTE;
}

// First message of glslang: "ERROR: lib/brdf.glsl:12: 'x' : undeclared identifier".
static enum hg_status report(const char *name, const char *log, struct hg_error *err)
{
    const char *error = strstr(log, "ERROR: ");
    const char *start = error != NULL ? error + 7 : log;
    const char *colon = strchr(start, ':');
    const size_t length = strcspn(start, "\n");
    char file[128], where[64] = "";
    snprintf(file, sizeof file, "%s", name);
    const char *reason = start;
    unsigned line;
    int used = 0;
    if (colon != NULL && (size_t)(colon - start) < length &&
        sscanf(colon, ":%u: %n", &line, &used) == 1 && used > 0) {
        if (colon - start < (int)sizeof file && strncmp(start, "0:", 2) != 0)
            snprintf(file, sizeof file, "%.*s", (int)(colon - start), start);
        snprintf(where, sizeof where, "line %u", line);
        reason = colon + used;
    }
    return hg_error_set(
        err, HG_E_FORMAT, file, where, "%.*s", (int)(length - (size_t)(reason - start)), reason);
}

static enum hg_status copy_words(
    glslang_program_t *program, uint32_t **words, size_t *size_bytes, struct hg_error *err)
{
    const size_t count = glslang_program_SPIRV_get_size(program);
    *words = hg_calloc(count, sizeof **words);
    if (*words == NULL)
        return hg_error_set(err, HG_E_NOMEM, "shader", NULL, "out of host memory");
    glslang_program_SPIRV_get(program, *words);
    *size_bytes = count * sizeof **words;
    return HG_OK;
}

static enum hg_status link_program(const char *name, glslang_shader_t *shader,
    glslang_stage_t stage, uint32_t **words, size_t *size_bytes, struct hg_error *err)
{
    glslang_program_t *program = glslang_program_create();
    glslang_program_add_shader(program, shader);
    enum hg_status status = HG_OK;
    if (!glslang_program_link(program, GLSLANG_MSG_SPV_RULES_BIT | GLSLANG_MSG_VULKAN_RULES_BIT))
        status = report(name, glslang_program_get_info_log(program), err);
    if (status == HG_OK) {
        glslang_program_SPIRV_generate(program, stage);
        status = copy_words(program, words, size_bytes, err);
    }
    glslang_program_delete(program);
    return status;
}

static enum hg_status compile_text(
    const char *name, const char *text, uint32_t **words, size_t *size_bytes, struct hg_error *err)
{
    const glslang_input_t input = {
        .language = GLSLANG_SOURCE_GLSL,
        .stage = stage_of(name),
        .client = GLSLANG_CLIENT_VULKAN,
        .client_version = GLSLANG_TARGET_VULKAN_1_3,
        .target_language = GLSLANG_TARGET_SPV,
        .target_language_version = GLSLANG_TARGET_SPV_1_6,
        .code = text,
        .default_version = 460,
        .default_profile = GLSLANG_NO_PROFILE,
        .messages = GLSLANG_MSG_SPV_RULES_BIT | GLSLANG_MSG_VULKAN_RULES_BIT,
        .resource = glslang_default_resource(),
    };
    glslang_shader_t *shader = glslang_shader_create(&input);
    if (shader == NULL)
        return hg_error_set(err, HG_E_NOMEM, name, NULL, "glslang has no memory");
    enum hg_status status;
    if (!glslang_shader_preprocess(shader, &input) || !glslang_shader_parse(shader, &input))
        status = report(name, glslang_shader_get_info_log(shader), err);
    else
        status = link_program(name, shader, input.stage, words, size_bytes, err);
    glslang_shader_delete(shader);
    return status;
}

enum hg_status hg_gpu_compile(
    const char *root, const char *name, uint32_t **words, size_t *size_bytes, struct hg_error *err)
{
    *words = NULL;
    *size_bytes = 0;
    char file[128];
    if (snprintf(file, sizeof file, "passes/%s", name) >= (int)sizeof file)
        return hg_error_set(err, HG_E_INVAL, name, NULL, "name is too long");
    struct expansion *e = hg_calloc(1, sizeof *e);
    if (e == NULL)
        return hg_error_set(err, HG_E_NOMEM, name, NULL, "out of host memory");
    *e = (struct expansion){.root = root, .err = err, .text.limit_bytes = 8 * MAX_BYTES};
    enum hg_status status = expand(e, file, 0);
    hg_write_u8(&e->text, 0);
    if (status == HG_OK && e->text.failed)
        status = hg_error_set(err, HG_E_LIMIT, file, NULL, "the expanded source is too large");
    if (status == HG_OK) {
        pthread_mutex_lock(&lock);
        if (glslang_initialize_process())
            status = compile_text(file, (const char *)e->text.data, words, size_bytes, err);
        else
            status = hg_error_set(err, HG_E_NOMEM, file, NULL, "glslang could not start");
        glslang_finalize_process();
        pthread_mutex_unlock(&lock);
    }
    hg_writer_finish(&e->text);
    hg_free(e);
    return status;
}
