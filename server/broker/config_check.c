#include "server/broker/config_check.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "server/broker/connection/listener.h"
#include "server/broker/privileges.h"
#include "server/broker/transport/address_list.h"
#include "server/broker/workers/worker_process.h"

// ---- what reload applies ------------------------------------------------------------------------

enum hg_status hg_config_read_tokens(
    const struct hg_options *o, struct hg_tokens *out, struct hg_error *err)
{
    *out = (struct hg_tokens){0};
    return o->tokens ? hg_tokens_read(o->tokens, out, err) : HG_OK;
}

enum hg_status hg_config_check_listen(
    const struct hg_options *o, const struct hg_tokens *tokens, struct hg_error *err)
{
    for (size_t i = 0; i < o->listen.count; i++) {
        bool is_tcp, is_tls;
        enum hg_status status = hg_listener_check(o->listen.items[i], &is_tcp, &is_tls, err);
        if (!status && is_tls && !o->tls_cert)
            status = hg_error_set(err, HG_E_INVAL, o->listen.items[i], NULL,
                "tls needs a certificate; name it with --tls-cert");
        if (!status && is_tcp && !tokens->count)
            status = hg_error_set(err, HG_E_INVAL, o->listen.items[i], NULL,
                "tcp clients need tokens; name a file with --tokens");
        if (status)
            return status;
    }
    return HG_OK;
}

// As browsers send it: SCHEME://HOST[:PORT], and nothing behind.
static enum hg_status check_origins(const struct hg_options *o, struct hg_error *err)
{
    for (size_t i = 0; i < o->allowed_origins.count; i++) {
        const char *origin = o->allowed_origins.items[i], *host = strstr(origin, "://");
        if (!host || host == origin || !host[3] || strpbrk(host + 3, "/?#*@ "))
            return hg_error_set(err, HG_E_INVAL, "--allowed-origins", NULL,
                "'%s' is no origin: expected https://HOST[:PORT], without a path or '*'", origin);
    }
    return HG_OK;
}

static bool is_exposed(const char *path)
{
    struct stat st;
    return path && stat(path, &st) == 0 && st.st_mode & S_IROTH;
}

void hg_config_warn(
    const struct hg_options *o, const struct hg_tokens *tokens, const struct hg_tls *tls)
{
    const char *key = o->tls_key ? o->tls_key : o->tls_cert;
    if (tokens->exposed)
        hg_warn(AUTH, "the token file %s can be read by others than its owner", o->tokens);
    if (tokens->plain)
        hg_warn(AUTH,
            "%u tokens stand in %s as they are; heliod --hash-token makes lines without them",
            tokens->plain, o->tokens);
    if (is_exposed(key))
        hg_warn(AUTH, "the private key in %s can be read by all users", key);
    hg_tls_warn(tls, o->tls_cert);
}

void hg_config_warn_unreadable(const struct hg_options *o, const char *user)
{
    const char *files[] = {o->config, o->tokens, o->tls_cert, o->tls_key, o->tls_client_ca};
    for (size_t i = 0; i < sizeof files / sizeof *files; i++)
        if (files[i] && access(files[i], R_OK) != 0)
            hg_warn(AUTH, "%s cannot read %s: every reload will be refused", user, files[i]);
}

enum hg_status hg_config_check(const struct hg_options *o, struct hg_error *err)
{
    struct hg_tokens tokens;
    struct hg_tls tls = {0};
    enum hg_status status = hg_config_read_tokens(o, &tokens, err);
    if (!status)
        status = hg_config_check_listen(o, &tokens, err);
    if (!status)
        status = hg_address_list_check(&o->metrics_from, "--metrics-from", err);
    if (!status)
        status = hg_address_list_check(&o->proxy_from, "--proxy-from", err);
    if (!status)
        status = check_origins(o, err);
    if (!status && o->log)
        status = hg_log_configure(o->log, err);
    if (!status)
        status = hg_tls_open(o, &tls, err);
    if (!status)
        hg_config_warn(o, &tokens, &tls);
    hg_tls_finish(&tls);
    hg_tokens_finish(&tokens);
    return status;
}

// ---- what a start needs -------------------------------------------------------------------------

static enum hg_status fail(const char *path, const char *option, struct hg_error *err)
{
    const int number = errno;
    return hg_error_set(
        err, hg_status_from_errno(number), path, NULL, "%s: %s", option, strerror(number));
}

// A folder that is there. Rights are those of the user who checks: root has them all.
static enum hg_status check_folder(
    const char *path, const char *option, int rights, struct hg_error *err)
{
    struct stat st;
    if (stat(path, &st) != 0)
        return fail(path, option, err);
    if (!S_ISDIR(st.st_mode))
        errno = ENOTDIR;
    else if (access(path, rights) == 0)
        return HG_OK;
    return fail(path, option, err);
}

// What is to be made there: the folder that it is made in is there.
static enum hg_status check_parent(const char *path, const char *option, struct hg_error *err)
{
    char folder[4096];
    const char *slash = strrchr(path, '/');
    const int length = slash ? (int)(slash - path) : 0;
    snprintf(folder, sizeof folder, "%.*s", length, path);
    return check_folder(!slash ? "." : length ? folder : "/", option, W_OK | X_OK, err);
}

static enum hg_status check_made(const char *path, const char *option, struct hg_error *err)
{
    return access(path, F_OK) == 0 ? check_folder(path, option, R_OK | W_OK | X_OK, err)
                                   : check_parent(path, option, err);
}

static enum hg_status check_folders(const struct hg_options *o, struct hg_error *err)
{
    enum hg_status status = hg_worker_process_check_roots(o, err);
    const bool has_group = strcmp(o->cgroup, "auto") != 0 && strcmp(o->cgroup, "off") != 0;
    if (!status && o->state_dir)
        status = check_made(o->state_dir, "--state-dir", err);
    if (!status && o->cache_dir && access(o->cache_dir, F_OK) == 0) // else all of it is made
        status = check_folder(o->cache_dir, "--cache-dir", R_OK | W_OK | X_OK, err);
    if (!status && o->web_root && strcmp(o->web_root, "off") != 0)
        status = check_folder(o->web_root, "--web-root", R_OK | X_OK, err);
    if (!status && o->shader_dir)
        status = check_folder(o->shader_dir, "--shader-dir", R_OK | X_OK, err);
    if (!status && has_group)
        status = check_folder(o->cgroup, "--cgroup", X_OK, err);
    if (!status && o->audit)
        status = check_parent(o->audit, "--audit", err);
    if (!status && o->port_file)
        status = check_parent(o->port_file, "--port-file", err);
    for (size_t i = 0; i < o->listen.count && !status; i++)
        if (strncmp(o->listen.items[i], "unix:", 5) == 0)
            status = check_parent(o->listen.items[i] + 5, "--listen", err);
    return status;
}

enum hg_status hg_config_check_start(const struct hg_options *o, struct hg_error *err)
{
    char path[4096];
    struct hg_user user;
    enum hg_status status = o->user ? hg_user_find(&user, o->user, err) : HG_OK;
    if (!status && !hg_worker_process_find(o, path, sizeof path))
        status = hg_error_set(
            err, HG_E_NOTFOUND, path, NULL, "the worker's program is not there (--worker)");
    return status ? status : check_folders(o, err);
}
