#include "server/broker/session/session_list.h"

#include <stdio.h>
#include <string.h>

#include "base/json.h"
#include "base/sha256.h"
#include "server/broker/session/session_view.h"

static void put_session(struct hg_writer *w, const struct hg_session *s)
{
    const struct hg_conn *conn = s->conn;
    uint32_t views = 0;
    for (const struct hg_session_view *it = s->views; it; it = it->next)
        views++;
    hg_json_put_number(w, "{\"session\":", s->number);
    hg_json_put_text(w, ",\"name\":", s->name);
    hg_json_put_text(w, ",\"role\":", hgp_enum_name("role", s->role));
    hg_json_put_text(w, ",\"label\":", s->share.label);
    hg_json_put_text(w, ",\"tenant\":", s->tenant);
    hg_json_put_text(w, ",\"peer\":", conn ? conn->peer.name : "");
    hg_json_put_text(w, ",\"client\":", conn ? conn->client : "");
    hg_json_put_text(w, ",\"scene\":", s->scene ? s->scene->key : "");
    hg_json_put_number(w, ",\"views\":", views);
    hg_json_put_number(w, ",\"pixels\":", hg_session_view_pixels(s));
    hg_json_put_number(w, ",\"requests\":", s->load.count);
    hg_json_put_number(w, ",\"frames\":", s->pace.frames);
    hg_json_put_number(w, ",\"frame_pixels\":", s->pace.pixels);
    hg_json_put_number(w, ",\"frame_bytes\":", s->pace.frame_bytes);
    hg_json_put_number(w, ",\"waits_for_pixels\":", s->pace.waits);
    hg_json_put_number(w, ",\"uploaded_bytes\":", s->bytes.uploaded);
    hg_json_put_number(w, ",\"received_bytes\":", conn ? conn->in.total_bytes : 0);
    hg_json_put_number(w, ",\"waiting_bytes\":", conn ? conn->out.bytes : 0);
    hg_json_put_number(w, ",\"parked_s\":",
        s->resume.parked_ns ? (s->table->loop->now_ns - s->resume.parked_ns) / 1000000000u : 0);
    hg_json_put_number(
        w, ",\"open_s\":", conn ? (s->table->loop->now_ns - conn->opened_ns) / 1000000000u : 0);
    hg_json_put(w, "}");
}

static void put_scene(struct hg_writer *w, const struct hg_shared_scene *scene)
{
    struct hg_journal_stats stats = hg_journal_get_stats(scene->journal);
    hg_json_put_text(w, "{\"scene\":", scene->key);
    hg_json_put_text(w, ",\"name\":", scene->name);
    hg_json_put_number(w, ",\"sessions\":", scene->sessions);
    hg_json_put_number(w, ",\"revision\":", scene->revision);
    hg_json_put_number(w, ",\"camera_holder\":", scene->people.camera.holder);
    hg_json_put_number(w, ",\"annotations\":", scene->people.annotations.count);
    hg_json_put_number(w, ",\"journal_entries\":", stats.entries);
    hg_json_put_number(w, ",\"journal_bytes\":", stats.bytes);
    hg_json_put(w, "}");
}

static void put_worker(struct hg_writer *w, const struct hg_link *link)
{
    static const char *const states[] = {"down", "starting", "up"};
    hg_json_put_text(w, "{\"state\":", states[link->state]);
    hg_json_put_number(w, ",\"pid\":", (uint64_t)link->pid);
    hg_json_put_number(w, ",\"deaths\":", link->deaths);
    hg_json_put_text(w, ",\"tenant\":", link->whose.tenant);
    hg_json_put_number(w, ",\"rss_bytes\":", link->rss_bytes);
    hg_json_put_number(w, ",\"memory_limit_bytes\":", link->whose.share.memory_bytes);
    hg_json_put_number(w, ",\"weight\":", link->whose.weight);
    hg_json_put_number(w, ",\"waiting_bytes\":", link->out.bytes);
    hg_json_put(w, "}");
}

void hg_session_list_write(struct hg_writer *w, const struct hg_session_table *table)
{
    const char *separator = "";
    hg_json_put(w, "{\"sessions\":[");
    for (const struct hg_session *it = table->first; it; it = it->next, separator = ",") {
        hg_json_put(w, "%s", separator);
        put_session(w, it);
    }
    hg_json_put(w, "],\"scenes\":[");
    separator = "";
    for (const struct hg_shared_scene *it = table->scenes.first; it; it = it->next) {
        hg_json_put(w, "%s", separator);
        put_scene(w, it);
        separator = ",";
    }
    hg_json_put(w, "],\"workers\":[");
    separator = "";
    for (uint32_t i = 0; i < table->pool->count; i++) {
        if (!table->pool->links[i].whose.wanted)
            continue;
        hg_json_put(w, "%s", separator);
        put_worker(w, &table->pool->links[i]);
        separator = ",";
    }
    hg_json_put(w, "]");
    hg_json_put_number(w, ",\"connections\":", table->conns->slots.count);
    hg_json_put_number(w, ",\"tickets\":", table->tickets->count);
    hg_json_put_number(w, ",\"upload_store_bytes\":", hg_upload_store_bytes(table->store));
    hg_json_put_number(
        w, ",\"uptime_s\":", (table->loop->now_ns - table->started_ns) / 1000000000u);
    hg_json_put(
        w, table->draining || table->drain.due_ns ? ",\"draining\":true}" : ",\"draining\":false}");
}

void hg_session_list_answer(
    struct hg_session *asker, uint32_t request, struct hg_writer *w, const char *what)
{
    struct hg_error err = {0};
    if (w->failed) {
        hg_error_set(&err, HG_E_NOMEM, what, NULL, "no memory for the answer");
        hg_conn_fail(asker->conn, request, &err);
    } else if (request) {
        hg_conn_send(asker->conn, request, HGP_T_json,
            &(struct hgp_json){.text = {(const char *)w->data, (uint32_t)w->size}});
    }
    hg_writer_finish(w);
}

void hg_session_list(struct hg_session *asker, uint32_t request)
{
    struct hg_writer w = {.limit_bytes = 16 << 20};
    hg_session_list_write(&w, asker->table);
    hg_session_list_answer(asker, request, &w, "sessions_query");
}

static void put_entry(struct hg_writer *w, const struct hg_quarantine_entry *entry, uint64_t now_ns)
{
    char hex[HG_SHA256_HEX];
    hg_sha256_hex(entry->key, hex);
    hg_json_put_text(w, "{\"key\":", hex);
    hg_json_put_text(w, ",\"tenant\":", entry->tenant);
    hg_json_put_text(w, ",\"file\":", entry->what);
    hg_json_put_number(w, ",\"deaths\":", entry->deaths);
    hg_json_put_number(w,
        ",\"refused_s\":", entry->until_ns > now_ns ? (entry->until_ns - now_ns) / 1000000000u : 0);
    hg_json_put(w, "}");
}

void hg_session_list_quarantine(struct hg_session *asker, uint32_t request)
{
    struct hg_writer w = {.limit_bytes = 16 << 20};
    const uint64_t now_ns = asker->table->loop->now_ns;
    const char *separator = "{\"quarantine\":[";
    for (uint32_t i = 0; i < HG_QUARANTINE_ENTRIES; i++) {
        const struct hg_quarantine_entry *it = &asker->table->quarantine->entries[i];
        if (!it->tenant[0] ||
            hg_quarantine_find(asker->table->quarantine, it->tenant, it->key, now_ns) != it)
            continue;
        hg_json_put(&w, "%s", separator);
        put_entry(&w, it, now_ns);
        separator = ",";
    }
    hg_json_put(&w, "%s", separator[0] == '{' ? "{\"quarantine\":[]}" : "]}");
    hg_session_list_answer(asker, request, &w, "quarantine_query");
}
