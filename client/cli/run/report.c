#include "client/cli/run/report.h"

#include <string.h>

#include "base/alloc.h"

enum hg_status hg_cli_report_begin(struct hg_cli_report *r, const char *suite)
{
    if (hg_grow(&r->suites, &r->suite_capacity, r->suite_count + 1, sizeof *r->suites))
        return HG_E_NOMEM;
    r->suites[r->suite_count] = hg_arena_strndup(&r->arena, suite, strlen(suite));
    if (!r->suites[r->suite_count])
        return HG_E_NOMEM;
    r->suite_count++;
    return HG_OK;
}

// False: no memory. An absent text stays absent.
static bool keep(struct hg_arena *arena, const char **text)
{
    if (*text)
        *text = hg_arena_strndup(arena, *text, strlen(*text));
    else
        return true;
    return *text != NULL;
}

enum hg_status hg_cli_report_add(struct hg_cli_report *r, const struct hg_cli_case *c)
{
    struct hg_cli_case copy = *c;
    const char **texts[] = {&copy.name, &copy.message, &copy.pictures.picture,
        &copy.pictures.reference, &copy.pictures.difference};
    if (hg_grow(&r->cases, &r->capacity, r->count + 1, sizeof *r->cases))
        return HG_E_NOMEM;
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        if (!keep(&r->arena, texts[i]))
            return HG_E_NOMEM;
    copy.suite = r->suite_count > 0 ? (uint32_t)(r->suite_count - 1) : 0;
    r->cases[r->count++] = copy;
    return HG_OK;
}

size_t hg_cli_report_count(
    const struct hg_cli_report *r, int64_t suite, enum hg_cli_verdict verdict)
{
    size_t n = 0;
    for (size_t i = 0; i < r->count; i++)
        n += r->cases[i].verdict == verdict && (suite < 0 || r->cases[i].suite == suite);
    return n;
}

void hg_cli_report_finish(struct hg_cli_report *r)
{
    hg_arena_finish(&r->arena);
    hg_free(r->suites);
    hg_free(r->cases);
    *r = (struct hg_cli_report){0};
}

// ---- escaping ----------------------------------------------------------------------------------

// Length of the well-formed UTF-8 character at `p` that XML 1.0 allows; 0 when it is none.
static size_t character(const unsigned char *p)
{
    if (p[0] < 0x80)
        return p[0] >= 0x20 || p[0] == '\t' || p[0] == '\n' ? 1 : 0;
    size_t n = p[0] >= 0xc2 && p[0] < 0xe0   ? 2
               : p[0] >= 0xe0 && p[0] < 0xf0 ? 3
               : p[0] >= 0xf0 && p[0] < 0xf5 ? 4
                                             : 0;
    for (size_t i = 1; i < n; i++)
        if ((p[i] & 0xc0) != 0x80)
            return 0;
    if ((p[0] == 0xe0 && p[1] < 0xa0) || (p[0] == 0xed && p[1] >= 0xa0) ||
        (p[0] == 0xf0 && p[1] < 0x90) || (p[0] == 0xf4 && p[1] >= 0x90))
        return 0;
    if (p[0] == 0xef && p[1] == 0xbf && p[2] >= 0xbe) // U+FFFE, U+FFFF
        return 0;
    return n;
}

void hg_cli_report_escape(struct hg_writer *w, const char *text)
{
    for (const unsigned char *p = (const unsigned char *)text; *p;) {
        size_t n = character(p);
        const char *entity = *p == '&'    ? "&amp;"
                             : *p == '<'  ? "&lt;"
                             : *p == '>'  ? "&gt;"
                             : *p == '"'  ? "&quot;"
                             : *p == '\'' ? "&apos;"
                             : *p == '\n' ? "&#10;"
                             : *p == '\t' ? "&#9;"
                             : n == 0     ? "?"
                                          : NULL;
        if (entity)
            hg_write_bytes(w, entity, strlen(entity));
        else
            hg_write_bytes(w, p, n);
        p += n ? n : 1;
    }
}
