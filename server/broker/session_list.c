// session_list.c - one JSON object about all sessions, scenes and the worker.
#include <stdio.h>
#include <string.h>

#include "server/broker/broker.h"

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
    put_number(w, ",\"pixels\":", hg_session_pixels(s));
    put_number(w, ",\"requests\":", s->request_count);
    put_number(w, ",\"uploaded_bytes\":", s->uploaded_bytes);
    put_number(w, ",\"received_bytes\":", conn ? conn->in.total_bytes : 0);
    put_number(w, ",\"waiting_bytes\":", conn ? conn->out.bytes : 0);
    put_number(
        w, ",\"open_s\":", conn ? (s->broker->loop.now_ns - conn->opened_ns) / 1000000000u : 0);
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

static void put_worker(struct hg_writer *w, const struct hg_broker *b)
{
    static const char *const states[] = {"down", "starting", "up"};
    put_text(w, "\"worker\":{\"state\":", states[b->link.state]);
    put_number(w, ",\"pid\":", (uint64_t)b->link.pid);
    put_number(w, ",\"deaths\":", b->link.deaths);
    put_number(w, ",\"rss_bytes\":", b->link.rss_bytes);
    put_number(w, ",\"waiting_bytes\":", b->link.out.bytes);
    put(w, "}");
}

void hg_session_list(struct hg_session *asker, uint32_t request)
{
    const struct hg_broker *b = asker->broker;
    struct hg_writer w = {.limit_bytes = 16 << 20};
    const char *separator = "";
    put(&w, "{\"sessions\":[");
    for (const struct hg_session *it = b->sessions; it; it = it->next, separator = ",") {
        put(&w, separator);
        put_session(&w, it);
    }
    put(&w, "],\"scenes\":[");
    separator = "";
    for (const struct hg_shared_scene *it = b->scenes; it; it = it->next, separator = ",") {
        put(&w, separator);
        put_scene(&w, it);
    }
    put(&w, "],");
    put_worker(&w, b);
    put_number(&w, ",\"connections\":", b->conn_count);
    put_number(&w, ",\"upload_store_bytes\":", hg_upload_store_bytes(b->store));
    put_number(&w, ",\"uptime_s\":", (b->loop.now_ns - b->started_ns) / 1000000000u);
    put(&w, b->draining ? ",\"draining\":true}" : ",\"draining\":false}");
    struct hg_error err = {0};
    if (w.failed) {
        hg_error_set(&err, HG_E_NOMEM, "sessions_query", NULL, "no memory for the answer");
        hg_conn_fail(asker->conn, request, &err);
    } else if (request) {
        hg_conn_send(asker->conn, request, HGP_T_json,
            &(struct hgp_json){.text = {(const char *)w.data, (uint32_t)w.size}});
    }
    hg_writer_finish(&w);
}
