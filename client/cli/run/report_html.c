// report_html.c - reports as a page with pictures. See report.h.
#include <stdio.h>
#include <string.h>

#include "client/cli/run/report.h"

static const char head[] =
    "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
    "<meta name=\"viewport\" content=\"width=device-width\"><title>helio run</title>\n<style>\n"
    "body{font:16px/1.5 system-ui,sans-serif;margin:2em auto;max-width:75em;padding:0 1em;"
    "color:#222;background:#fff}\n"
    "h2{margin:1.5em 0 .3em}\n"
    "li{margin:.3em 0}\n"
    "code{overflow-wrap:anywhere}\n"
    ".verdict{display:inline-block;min-width:5em;font-weight:bold}\n"
    ".failed .verdict,.error .verdict{color:#b00020}\n"
    ".passed .verdict,.updated .verdict{color:#0b6b2e}\n"
    ".pictures{display:flex;flex-wrap:wrap;gap:1em;margin:.5em 0 1em}\n"
    "figure{margin:0;flex:1 1 15em}\n"
    "img{max-width:100%;image-rendering:pixelated;background:repeating-conic-gradient(#ccc 0 25%,"
    "#fff 0 50%) 0 0/16px 16px}\n"
    "@media(prefers-color-scheme:dark){body{color:#ddd;background:#161616}"
    ".failed .verdict,.error .verdict{color:#ff8a95}"
    ".passed .verdict,.updated .verdict{color:#7ddc9b}}\n"
    "</style></head><body>\n<h1>helio run</h1>\n";

static void put(struct hg_writer *w, const char *text)
{
    hg_write_bytes(w, text, strlen(text));
}

// A name as part of a URL: all but unreserved characters as %XX.
static void put_url(struct hg_writer *w, const char *name)
{
    static const char plain[] =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-._~";
    char coded[4];
    for (const char *p = name; *p; p++) {
        if (strchr(plain, *p)) {
            hg_write_bytes(w, p, 1);
            continue;
        }
        snprintf(coded, sizeof coded, "%%%02X", (unsigned)(unsigned char)*p);
        put(w, coded);
    }
}

// Browsers show PNG and JPEG files; others are linked.
static void put_picture(struct hg_writer *w, const char *title, const char *name)
{
    const char *dot = name ? strrchr(name, '.') : NULL;
    if (!name)
        return;
    const bool shown = dot && strcmp(dot, ".exr") != 0;
    put(w, "<figure><figcaption>");
    put(w, title);
    put(w, "</figcaption><a href=\"");
    put_url(w, name);
    put(w, "\">");
    if (shown) {
        put(w, "<img alt=\"");
        put(w, title);
        put(w, "\" src=\"");
        put_url(w, name);
        put(w, "\">");
    } else {
        hg_cli_report_escape(w, name);
    }
    put(w, "</a></figure>\n");
}

static void put_case(struct hg_writer *w, const struct hg_cli_case *c)
{
    static const char *const verdicts[] = {[HG_CLI_PASSED] = "passed",
        [HG_CLI_UPDATED] = "updated",
        [HG_CLI_DIFFERS] = "failed",
        [HG_CLI_BROKEN] = "error",
        [HG_CLI_SKIPPED] = "skipped"};
    const struct hg_cli_pictures *p = &c->pictures;
    put(w, "<li class=\"");
    put(w, verdicts[c->verdict]);
    put(w, "\"><span class=\"verdict\">");
    put(w, verdicts[c->verdict]);
    put(w, "</span> <code>");
    hg_cli_report_escape(w, c->name);
    put(w, "</code>");
    if (c->message && c->verdict != HG_CLI_PASSED) {
        put(w, "<br><code>");
        hg_cli_report_escape(w, c->message);
        put(w, "</code>");
    }
    if (p->picture || p->reference || p->difference) {
        put(w, "\n<div class=\"pictures\">\n");
        put_picture(w, "picture", p->picture);
        put_picture(w, "reference", p->reference);
        put_picture(w, "difference", p->difference);
        put(w, "</div>");
    }
    put(w, "</li>\n");
}

static void put_counts(struct hg_writer *w, const struct hg_cli_report *r, int64_t suite)
{
    char text[160];
    snprintf(text, sizeof text,
        "<p>%zu passed, %zu updated, %zu failed, %zu errors, %zu skipped</p>\n",
        hg_cli_report_count(r, suite, HG_CLI_PASSED), hg_cli_report_count(r, suite, HG_CLI_UPDATED),
        hg_cli_report_count(r, suite, HG_CLI_DIFFERS), hg_cli_report_count(r, suite, HG_CLI_BROKEN),
        hg_cli_report_count(r, suite, HG_CLI_SKIPPED));
    put(w, text);
}

enum hg_status hg_cli_report_write_html(const struct hg_cli_report *r, struct hg_writer *w)
{
    put(w, head);
    put_counts(w, r, -1);
    for (uint32_t suite = 0; suite < r->suite_count; suite++) {
        put(w, "<h2><code>");
        hg_cli_report_escape(w, r->suites[suite]);
        put(w, "</code></h2>\n");
        if (r->suite_count > 1)
            put_counts(w, r, suite);
        put(w, "<ul>\n");
        for (size_t i = 0; i < r->count; i++)
            if (r->cases[i].suite == suite)
                put_case(w, &r->cases[i]);
        put(w, "</ul>\n");
    }
    put(w, "</body></html>\n");
    return w->failed ? HG_E_NOMEM : HG_OK;
}
