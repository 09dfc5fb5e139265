#include "server/broker/session/session_sync.h"

#include <string.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/sha256.h"
#include "server/broker/session/session_audit.h"

struct hg_session_sync {
    struct hg_session_sync *next;
    struct hg_state_sync files; // the content and its folder
    uint32_t session, request;  // session 0: its connection is gone
    uint8_t hash[32];
};

enum hg_status hg_session_sync_begin(
    struct hg_session_table *table, const struct hg_session_synced *content, struct hg_error *err)
{
    struct hg_session_sync *it = hg_calloc(1, sizeof *it);
    if (!it) {
        close(content->content_fd);
        close(content->folder_fd);
        return hg_error_set(err, HG_E_NOMEM, "upload", NULL, "no memory to sync it");
    }
    it->session = content->session;
    it->request = content->request;
    memcpy(it->hash, content->hash, sizeof it->hash);
    if (!table->syncs.first)
        table->syncs.last = &table->syncs.first;
    *table->syncs.last = it;
    table->syncs.last = &it->next;
    hg_state_log_sync_file(table->scenes.log, content->content_fd, &it->files);
    hg_state_log_sync_file(table->scenes.log, content->folder_fd, &it->files);
    return HG_OK;
}

static void answer(struct hg_session_table *table, const struct hg_session_sync *it)
{
    struct hg_session *s = it->session ? hg_session_find(table, it->session) : NULL;
    struct hg_error err = {0};
    if (it->files.status) {
        hg_upload_store_forget(table->store, it->hash);
        hg_error_set(&err, it->files.status, "upload", NULL,
            "the content cannot be synced to the disk, and is not kept: %s",
            hg_status_text(it->files.status));
    }
    if (!s || !s->conn)
        return;
    if (err.status) {
        char hex[HG_SHA256_HEX];
        hg_sha256_hex(it->hash, hex);
        hg_session_audit(s, "upload", err.status, hex);
        hg_conn_fail(s->conn, it->request, &err);
    } else if (it->request) {
        hg_conn_send(s->conn, it->request, HGP_T_ok, &(struct hgp_ok){0});
    }
}

void hg_session_sync_end(struct hg_session_table *table)
{
    struct hg_session_sync *it;
    while ((it = table->syncs.first) != NULL && !it->files.left) { // they end in their order
        table->syncs.first = it->next;
        answer(table, it);
        hg_free(it);
    }
}

void hg_session_sync_unask(const struct hg_session *s)
{
    for (struct hg_session_sync *it = s->table->syncs.first; it; it = it->next)
        if (it->session == s->number)
            it->session = 0;
}

bool hg_session_sync_waits(const struct hg_session_table *table, const struct hg_session *s)
{
    const struct hg_session_sync *it = table->syncs.first;
    while (it && s && it->session != s->number)
        it = it->next;
    return it != NULL;
}

void hg_session_sync_finish(struct hg_session_table *table)
{
    for (struct hg_session_sync *it = table->syncs.first, *next; it; it = next) {
        next = it->next;
        hg_free(it);
    }
    table->syncs.first = NULL;
}
