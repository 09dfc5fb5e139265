// output.c - names of outputs: files, streams, "-" for the standard output, FORMAT:NAME for
// pictures.
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/file.h"
#include "client/cli/cli.h"

static const char standard_output[] = "/dev/stdout";

const char *hg_cli_output_path(const char *name)
{
    return strcmp(name, "-") == 0 ? standard_output : name;
}

bool hg_cli_is_stdout(const char *name)
{
    struct stat a, b;
    return strcmp(hg_cli_output_path(name), standard_output) == 0 ||
           (stat(name, &a) == 0 && fstat(STDOUT_FILENO, &b) == 0 && a.st_dev == b.st_dev &&
               a.st_ino == b.st_ino && S_ISFIFO(a.st_mode));
}

bool hg_cli_is_stream(const char *name)
{
    char *target;
    bool stream;
    if (hg_file_target(hg_cli_output_path(name), &target, &stream, NULL))
        return false;
    hg_free(target);
    return stream;
}

// ---- checks ------------------------------------------------------------------------------------

static enum hg_status check_stream(const char *path, struct hg_error *err)
{
    const int fd = hg_file_descriptor(path), flags = fd < 0 ? 0 : fcntl(fd, F_GETFL);
    // What another user has opened for this program may be written, whoever may open it again.
    if (fd >= 0)
        return flags >= 0 && (flags & O_ACCMODE) != O_RDONLY
                   ? HG_OK
                   : hg_error_set(err, HG_E_INVAL, path, NULL,
                         "cannot write to it: it is not open for writing");
    if (access(path, W_OK))
        return hg_error_set(err, hg_status_from_errno(errno), path, NULL, "cannot write to it: %s",
            strerror(errno));
    return HG_OK;
}

enum hg_status hg_cli_check_no_folder(const char *path, struct hg_error *err)
{
    struct stat st;
    return stat(path, &st) == 0 && S_ISDIR(st.st_mode)
               ? hg_error_set(err, HG_E_INVAL, path, NULL, "is a folder")
               : HG_OK;
}

static enum hg_status check_file(const char *path, const char *target, struct hg_error *err)
{
    char folder[PATH_MAX];
    struct stat st;
    if (strlen(target) >= sizeof folder)
        return hg_error_set(err, HG_E_INVAL, path, NULL, "the name is too long");
    enum hg_status status = hg_cli_check_no_folder(path, err);
    if (status)
        return status;
    snprintf(folder, sizeof folder, "%s", target);
    char *slash = strrchr(folder, '/');
    if (slash)
        slash[slash == folder] = 0;
    else
        snprintf(folder, sizeof folder, ".");
    if (stat(folder, &st) != 0 || !S_ISDIR(st.st_mode))
        return hg_error_set(err, HG_E_INVAL, path, NULL, "its folder '%s' does not exist", folder);
    if (access(folder, W_OK | X_OK))
        return hg_error_set(err, hg_status_from_errno(errno), path, NULL,
            "cannot write to its folder: %s", strerror(errno));
    return HG_OK;
}

enum hg_status hg_cli_check_output(const char *name, struct hg_error *err)
{
    const char *path = hg_cli_output_path(name);
    char *target;
    bool stream;
    enum hg_status status = hg_file_target(path, &target, &stream, err);
    if (status)
        return status;
    status = stream ? check_stream(path, err) : check_file(path, target, err);
    hg_free(target);
    return status;
}

enum hg_status hg_cli_write_output(
    const char *name, const void *data, size_t size, struct hg_error *err)
{
    return hg_file_write_atomic(hg_cli_output_path(name), data, size, err);
}

// ---- pictures ----------------------------------------------------------------------------------

enum picture_format { NO_FORMAT, PNG, JPEG, EXR };

static enum picture_format find_format(const char *name, size_t length)
{
    static const struct {
        const char *name;
        enum picture_format format;
    } known[] = {{"png", PNG}, {"jpg", JPEG}, {"jpeg", JPEG}, {"exr", EXR}};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (strlen(known[i].name) == length && strncasecmp(known[i].name, name, length) == 0)
            return known[i].format;
    return NO_FORMAT;
}

// The format that a name asks for, and the name without it.
static enum picture_format split_name(const char *name, const char **path)
{
    const char *colon = strchr(name, ':'), *dot = strrchr(name, '.');
    enum picture_format format = colon ? find_format(name, (size_t)(colon - name)) : NO_FORMAT;
    const bool prefixed = format != NO_FORMAT && colon[1];
    *path = prefixed ? colon + 1 : name;
    if (prefixed)
        return format;
    if (strcmp(name, "-") == 0)
        return PNG;
    return dot ? find_format(dot + 1, strlen(dot + 1)) : NO_FORMAT;
}

static enum hg_status check_format_options(
    const struct hg_cli_options *o, enum picture_format format, struct hg_error *err)
{
    if (o->bit_depth && format != PNG)
        return hg_error_set(err, HG_E_INVAL, "--bit-depth", NULL, "is for PNG files");
    if (o->exr && format != EXR)
        return hg_error_set(err, HG_E_INVAL, "--exr", NULL, "is for EXR files");
    if (o->has_jpeg_quality && format != JPEG)
        return hg_error_set(err, HG_E_INVAL, "--jpeg-quality", NULL, "is for JPEG files");
    return HG_OK;
}

enum hg_status hg_cli_format_of(const char *name, const struct hg_cli_options *o,
    struct hg_cli_format *out, struct hg_error *err)
{
    static const struct hg_cli_options none;
    const char *path;
    o = o ? o : &none;
    const enum picture_format format = split_name(name, &path);
    *out = (struct hg_cli_format){.path = hg_cli_output_path(path),
        .quality = (uint8_t)(o->has_jpeg_quality ? o->jpeg_quality : 90)};
    if (!format)
        return hg_error_set(err, HG_E_INVAL, name, NULL,
            "the name ends in none of .png .jpg .jpeg .exr; png:NAME, jpg:NAME or exr:NAME says it "
            "as well");
    enum hg_status status = check_format_options(o, format, err);
    if (status)
        return status;
    const bool deep = o->bit_depth && strcmp(o->bit_depth, "16") == 0;
    const bool full = o->exr && strcmp(o->exr, "float") == 0;
    out->encoding = format == PNG    ? deep ? HGP_encoding_PNG16 : HGP_encoding_PNG8
                    : format == JPEG ? HGP_encoding_JPEG
                    : full           ? HGP_encoding_EXR_FLOAT
                                     : HGP_encoding_EXR_HALF;
    return HG_OK;
}
