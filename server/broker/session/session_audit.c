#include "server/broker/session/session_audit.h"

#include <stdio.h>

#include "base/sha256.h"

void hg_session_audit(
    const struct hg_session *s, const char *event, enum hg_status result, const char *detail)
{
    const struct hg_conn *conn = s->conn;
    hg_audit_write(s->table->audit, event,
        &(struct hg_audit_actor){.session = s->number,
            .name = s->name,
            .tenant = s->tenant,
            .role = hgp_enum_name("role", s->role),
            .peer = conn ? conn->peer.name : NULL,
            .client = conn ? conn->client : NULL},
        result, detail);
}

// A path, or the name and the hash of what was uploaded.
static void describe_load(const struct hgp_asset_load *m, char *out, size_t size)
{
    char hex[HG_SHA256_HEX] = "";
    if (m->files.count) {
        hg_sha256_hex(m->files.items[0].hash, hex);
        snprintf(out, size, "%.*s sha256:%s and %u files more", (int)m->files.items[0].uri.size,
            m->files.items[0].uri.data, hex, m->files.count - 1);
    } else {
        snprintf(out, size, "%.*s", (int)m->path.size, m->path.size ? m->path.data : "");
    }
}

static void describe_environment(const struct hgp_environment_set *m, char *out, size_t size)
{
    char hex[HG_SHA256_HEX];
    if (m->has_hash) {
        hg_sha256_hex(m->hash, hex);
        snprintf(out, size, "sha256:%s", hex);
    } else if (m->has_path) {
        snprintf(out, size, "%.*s", (int)m->path.size, m->path.data);
    }
}

void hg_session_audit_answer(
    const struct hg_session *s, const struct hg_packet *request, enum hg_status result)
{
    const uint16_t type = request->header.type;
    struct hg_arena arena = {0};
    union hgp_any any;
    char detail[600] = "";
    if (type != HGP_T_asset_load && type != HGP_T_environment_set)
        return;
    if (hgp_decode(HGP_VERSION_MAX, type, hg_reader_make(request->payload, request->header.length),
            &arena, &any, NULL) == HG_OK) {
        if (type == HGP_T_asset_load)
            describe_load(&any.asset_load, detail, sizeof detail);
        else
            describe_environment(&any.environment_set, detail, sizeof detail);
    }
    hg_arena_finish(&arena);
    if (detail[0])
        hg_session_audit(s, hgp_find(type)->name, result, detail);
}
