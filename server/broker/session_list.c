#include "server/broker/session_list.h"

#include <stdio.h>
#include <string.h>

#include "server/broker/session_view.h"

static void put(struct hg_writer *w, const char *text)
{
    hg_write_bytes(w, text, strlen(text));
}

static void put_string(struct hg_writer *w, const char *text)
{
    put(w, "\"");
    for (; *text; text++) {
        char escaped[8];
        if (*text == '"' || *text == '\\')
            snprintf(escaped, sizeof escaped, "\\%c", *text);
        else if ((unsigned char)*text < 0x20)
            snprintf(escaped, sizeof escaped, "\\u%04x", (unsigned)*text);
        else
            snprintf(escaped, sizeof escaped, "%c", *text);
        put(w, escaped);
    }
    put(w, "\"");
}

// `key` comes with what stands before it: ",\"x\":" .
static void put_text(struct hg_writer *w, const char *key, const char *value)
{
    put(w, key);
    put_string(w, value);
}

static void put_number(struct hg_writer *w, const char *key, uint64_t value)
{
    char text[24];
    put(w, key);
    snprintf(text, sizeof text, "%llu", (unsigned long long)value);
    put(w, text);
}

static void put_session(struct hg_writer *w, const struct hg_session *s)
{
    const struct hg_conn *conn = s->conn;
    uint32_t views = 0;
    for (const struct hg_session_view *it = s->views; it; it = it->next)
        views++;
    put_number(w, "{\"session\":", s->number);
    put_text(w, ",\"name\":", s->name);
    put_text(w, ",\"role\":", hgp_enum_name("role", s->role));
    put_text(w, ",\"peer\":", conn ? conn->peer.name : "");
    put_text(w, ",\"client\":", conn ? conn->client : "");
    put_text(w, ",\"scene\":", s->scene ? s->scene->key : "");
    put_number(w, ",\"views\":", views);
    put_number(w, ",\"pixels\":", hg_session_view_pixels(s));
    put_number(w, ",\"requests\":", s->request_count);
    put_number(w, ",\"uploaded_bytes\":", s->uploaded_bytes);
    put_number(w, ",\"received_bytes\":", conn ? conn->in.total_bytes : 0);
    put_number(w, ",\"waiting_bytes\":", conn ? conn->out.bytes : 0);
    put_number(
        w, ",\"open_s\":", conn ? (s->table->loop->now_ns - conn->opened_ns) / 1000000000u : 0);
    put(w, "}");
}

static void put_scene(struct hg_writer *w, const struct hg_shared_scene *scene)
{
    struct hg_journal_stats stats = hg_journal_get_stats(scene->journal);
    put_text(w, "{\"scene\":", scene->key);
    put_text(w, ",\"name\":", scene->name);
    put_number(w, ",\"sessions\":", scene->sessions);
    put_number(w, ",\"revision\":", scene->revision);
    put_number(w, ",\"journal_entries\":", stats.entries);
    put_number(w, ",\"journal_bytes\":", stats.bytes);
    put(w, "}");
}

static void put_worker(struct hg_writer *w, const struct hg_link *link)
{
    static const char *const states[] = {"down", "starting", "up"};
    put_text(w, "{\"state\":", states[link->state]);
    put_number(w, ",\"pid\":", (uint64_t)link->pid);
    put_number(w, ",\"deaths\":", link->deaths);
    put_text(w, ",\"tenant\":", link->whose.tenant);
    put_number(w, ",\"rss_bytes\":", link->rss_bytes);
    put_number(w, ",\"waiting_bytes\":", link->out.bytes);
    put(w, "}");
}

static void put_all(struct hg_writer *w, const struct hg_session_table *table)
{
    const char *separator = "";
    put(w, "{\"sessions\":[");
    for (const struct hg_session *it = table->first; it; it = it->next, separator = ",") {
        put(w, separator);
        put_session(w, it);
    }
    put(w, "],\"scenes\":[");
    separator = "";
    for (const struct hg_shared_scene *it = table->scenes.first; it; it = it->next) {
        put(w, separator);
        put_scene(w, it);
        separator = ",";
    }
    put(w, "],\"workers\":[");
    separator = "";
    for (uint32_t i = 0; i < table->pool->count; i++) {
        if (!table->pool->links[i].whose.wanted)
            continue;
        put(w, separator);
        put_worker(w, &table->pool->links[i]);
        separator = ",";
    }
    put(w, "]");
    put_number(w, ",\"connections\":", table->conns->slots.count);
    put_number(w, ",\"upload_store_bytes\":", hg_upload_store_bytes(table->store));
    put_number(w, ",\"uptime_s\":", (table->loop->now_ns - table->started_ns) / 1000000000u);
    put(w, table->draining ? ",\"draining\":true}" : ",\"draining\":false}");
}

void hg_session_list(struct hg_session *asker, uint32_t request)
{
    struct hg_writer w = {.limit_bytes = 16 << 20};
    struct hg_error err = {0};
    put_all(&w, asker->table);
    if (w.failed) {
        hg_error_set(&err, HG_E_NOMEM, "sessions_query", NULL, "no memory for the answer");
        hg_conn_fail(asker->conn, request, &err);
    } else if (request) {
        hg_conn_send(asker->conn, request, HGP_T_json,
            &(struct hgp_json){.text = {(const char *)w.data, (uint32_t)w.size}});
    }
    hg_writer_finish(&w);
}
