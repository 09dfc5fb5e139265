#include "server/broker/options.h"

#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/alloc.h"
#include "base/file.h"

enum kind { TEXT, CHOICE, LIST, COUNT, MIB, SECONDS, BOOL };
enum reload { START, LIVE };
enum { FILE_LIMIT_BYTES = 1 << 20 };

struct option {
    const char *group; // set on the first option of a group
    enum kind kind;
    const char *name, *metavar, *def, *help;
    double min, max;
    enum reload reload;
    size_t offset;
};

#define OFFSET_TEXT(member)    offsetof(struct hg_options, member)
#define OFFSET_CHOICE(member)  offsetof(struct hg_options, member)
#define OFFSET_LIST(member)    offsetof(struct hg_options, member)
#define OFFSET_COUNT(member)   offsetof(struct hg_options, member)
#define OFFSET_MIB(member)     offsetof(struct hg_options, member##_bytes)
#define OFFSET_SECONDS(member) offsetof(struct hg_options, member##_ns)
#define OFFSET_BOOL(member)    offsetof(struct hg_options, member)

// Group titles are rows without a name.
static const struct option table[] = {
#define HG_OPTION_GROUP(title) {.group = title},
#define HG_OPTION(k, member, n, meta, lo, hi, d, r, h)                                             \
    {.kind = k,                                                                                    \
        .name = n,                                                                                 \
        .metavar = meta,                                                                           \
        .def = d,                                                                                  \
        .help = h,                                                                                 \
        .min = lo,                                                                                 \
        .max = hi,                                                                                 \
        .reload = r,                                                                               \
        .offset = OFFSET_##k(member)},
#include "server/broker/options.def"
};

enum { TABLE_COUNT = sizeof table / sizeof *table };

// Flags that are no configuration keys.
static const struct {
    const char *name, *metavar, *help;
} extra[] = {
    {"config", "FILE", "Read options from FILE, one 'name = value' per line; flags override it."},
    {"check-config", "",
        "Check flags, file, tokens, certificates, and that folders and programs are there, as the "
        "user who runs it; then exit: 0 = good, 2 = not."},
    {"device-info", "", "Let the worker describe the Vulkan device and its fallbacks, then exit."},
    {"hash-token", "",
        "Read a token from standard input, print the word that stands for it in the file of "
        "tokens, then exit."},
    {"print-docs", "FORMAT",
        "Print this reference as markdown or man, or the table of metrics (metrics), then exit."},
    {"help", "", "Print this help, then exit."},
    {"version", "", "Print the version, then exit."},
};

static void *member(const struct hg_options *o, const struct option *row)
{
    return (char *)o + row->offset;
}

static const struct option *find_row(const char *name, size_t length)
{
    for (size_t i = 0; i < TABLE_COUNT; i++)
        if (table[i].name && strlen(table[i].name) == length &&
            memcmp(table[i].name, name, length) == 0)
            return &table[i];
    return NULL;
}

// ---- values -------------------------------------------------------------------------------------

static enum hg_status append_text(struct hg_text_list *list, const char *value)
{
    if (hg_grow(&list->items, &list->capacity, list->count + 1, sizeof *list->items))
        return HG_E_NOMEM;
    list->items[list->count] = hg_strdup(value);
    return list->items[list->count] ? (list->count++, HG_OK) : HG_E_NOMEM;
}

static void clear_list(struct hg_text_list *list)
{
    for (size_t i = 0; i < list->count; i++)
        hg_free(list->items[i]);
    hg_free(list->items);
    *list = (struct hg_text_list){0};
}

static bool parse_bool(const char *text, bool *out)
{
    static const char *const yes[] = {"true", "yes", "on", "1"}, *const no[] = {
                                                                     "false", "no", "off", "0"};
    for (size_t i = 0; i < 4; i++) {
        if (strcasecmp(text, yes[i]) == 0)
            return *out = true;
        if (strcasecmp(text, no[i]) == 0) {
            *out = false;
            return true;
        }
    }
    return false;
}

static bool parse_number(const struct option *row, const char *text, double *out)
{
    char *end;
    errno = 0;
    *out = strtod(text, &end);
    bool whole = *out == (double)(uint64_t)(*out < 0 || *out > 1e18 ? 0 : *out);
    return !errno && end != text && !*end && isdigit((unsigned char)text[0]) && *out >= row->min &&
           *out <= row->max && (row->kind == SECONDS || whole);
}

// The reason goes to err->reason; the caller adds the place.
static enum hg_status set_number(
    struct hg_options *o, const struct option *row, const char *value, struct hg_error *err)
{
    const char *what = row->kind == SECONDS               ? "seconds, a number"
                       : row->kind == MIB                 ? "MiB, a whole number"
                       : strcmp(row->metavar, "KIB") == 0 ? "KiB, a whole number"
                                                          : "a whole number";
    double number;
    if (!parse_number(row, value, &number))
        return hg_error_set(err, HG_E_INVAL, NULL, NULL,
            "%s takes %s from %.15g to %.15g without a unit, not '%s'", row->name, what, row->min,
            row->max, value);
    if (row->kind == COUNT)
        *(uint32_t *)member(o, row) = (uint32_t)number;
    else
        *(uint64_t *)member(o, row) =
            (uint64_t)(row->kind == MIB ? number * 1048576.0 : number * 1e9);
    return HG_OK;
}

// The values are in the metavar, "ONE|OTHER".
static bool is_choice(const struct option *row, const char *value)
{
    size_t length = strlen(value);
    for (const char *it = row->metavar; it; it = strchr(it, '|')) {
        it += *it == '|';
        if (length && strncmp(it, value, length) == 0 && (!it[length] || it[length] == '|'))
            return true;
    }
    return false;
}

static enum hg_status set_value(
    struct hg_options *o, const struct option *row, const char *value, struct hg_error *err)
{
    char **text = member(o, row), *copy;
    switch (row->kind) {
    case CHOICE:
        if (!is_choice(row, value))
            return hg_error_set(err, HG_E_INVAL, NULL, NULL, "%s takes %s, not '%s'", row->name,
                row->metavar, value);
        // fall through
    case TEXT:
        copy = *value ? hg_strdup(value) : NULL;
        if (*value && !copy)
            return hg_error_set(err, HG_E_NOMEM, row->name, NULL, "no memory");
        hg_free(*text);
        *text = copy;
        return HG_OK;
    case LIST:
        if (!*value)
            return hg_error_set(err, HG_E_INVAL, NULL, NULL, "%s needs a value", row->name);
        return append_text(member(o, row), value)
                   ? hg_error_set(err, HG_E_NOMEM, row->name, NULL, "no memory")
                   : HG_OK;
    case BOOL:
        if (parse_bool(value, member(o, row)))
            return HG_OK;
        return hg_error_set(
            err, HG_E_INVAL, NULL, NULL, "%s takes true or false, not '%s'", row->name, value);
    default:
        return set_number(o, row, value, err);
    }
}

static enum hg_status set_defaults(struct hg_options *o, struct hg_error *err)
{
    for (size_t i = 0; i < TABLE_COUNT; i++) {
        const struct option *row = &table[i];
        if (!row->name || !*row->def)
            continue;
        enum hg_status status = set_value(o, row, row->def, err);
        if (status)
            return status;
    }
    return HG_OK;
}

// ---- file ---------------------------------------------------------------------------------------

static char *trim(char *text)
{
    while (isspace((unsigned char)*text))
        text++;
    char *end = text + strlen(text);
    while (end > text && isspace((unsigned char)end[-1]))
        *--end = 0;
    return text;
}

static enum hg_status apply_line(struct hg_options *o, char *line, struct hg_error *err)
{
    line = trim(line);
    if (!*line || *line == '#')
        return HG_OK;
    char *equals = strchr(line, '=');
    if (!equals)
        return hg_error_set(err, HG_E_INVAL, NULL, NULL, "expected 'name = value'");
    *equals = 0;
    char *name = trim(line), *value = trim(equals + 1);
    const struct option *row = find_row(name, strlen(name));
    if (!row)
        return hg_error_set(err, HG_E_INVAL, NULL, NULL, "unknown option '%s'", name);
    return set_value(o, row, value, err);
}

static enum hg_status place_error(struct hg_error *err, const char *path, unsigned line)
{
    if (err) {
        snprintf(err->what, sizeof err->what, "%s", path);
        snprintf(err->where, sizeof err->where, "line %u", line);
    }
    return err ? err->status : HG_E_INVAL;
}

static enum hg_status read_file(struct hg_options *o, const char *path, struct hg_error *err)
{
    uint8_t *data;
    size_t size;
    enum hg_status status = hg_file_read(path, FILE_LIMIT_BYTES, &data, &size, err);
    if (status)
        return status;
    char *text = (char *)data;
    unsigned line = 1;
    for (char *next; text && !status; text = next, line++) {
        next = strchr(text, '\n');
        if (next)
            *next++ = 0;
        if (apply_line(o, text, err))
            status = place_error(err, path, line);
    }
    hg_free(data);
    return status;
}

// ---- flags --------------------------------------------------------------------------------------

struct flags {
    int argc, at;
    char *const *argv;
    const char *inline_value; // of --name=value
};

static enum hg_status take_value(
    struct flags *f, const char *name, const char **value, struct hg_error *err)
{
    *value = f->inline_value;
    if (!*value && f->at + 1 < f->argc)
        *value = f->argv[++f->at];
    if (!*value)
        return hg_error_set(err, HG_E_INVAL, name, NULL, "needs a value");
    return HG_OK;
}

static enum hg_status set_text(char **dst, const char *value)
{
    hg_free(*dst);
    *dst = hg_strdup(value);
    return *dst ? HG_OK : HG_E_NOMEM;
}

// HG_E_NOTFOUND: not one of the extra flags.
static enum hg_status apply_extra(
    struct hg_options *o, struct flags *f, const char *name, struct hg_error *err)
{
    static const struct {
        const char *name;
        enum hg_options_action action;
    } actions[] = {{"check-config", HG_OPTIONS_CHECK}, {"device-info", HG_OPTIONS_DEVICE_INFO},
        {"hash-token", HG_OPTIONS_HASH_TOKEN}, {"help", HG_OPTIONS_HELP},
        {"version", HG_OPTIONS_VERSION}};
    for (size_t i = 0; i < sizeof actions / sizeof *actions; i++)
        if (strcmp(name, actions[i].name) == 0) {
            o->action = actions[i].action;
            return HG_OK;
        }
    bool config = strcmp(name, "config") == 0, docs = strcmp(name, "print-docs") == 0;
    if (!config && !docs)
        return HG_E_NOTFOUND;
    const char *value;
    enum hg_status status = take_value(f, name, &value, err);
    if (status)
        return status;
    if (docs && strcmp(value, "man") != 0 && strcmp(value, "markdown") != 0 &&
        strcmp(value, "metrics") != 0)
        return hg_error_set(
            err, HG_E_INVAL, "--print-docs", NULL, "takes markdown, man or metrics");
    if (docs)
        o->action = HG_OPTIONS_DOCS;
    return set_text(config ? &o->config : &o->docs, value);
}

static enum hg_status apply_row(struct hg_options *o, struct flags *f, const struct option *row,
    bool *fresh, struct hg_error *err)
{
    const char *value = f->inline_value;
    enum hg_status status = HG_OK;
    if (row->kind != BOOL)
        status = take_value(f, row->name, &value, err);
    else if (!value)
        value = "true";
    if (!status && row->kind == LIST && !fresh[row - table]) {
        clear_list(member(o, row)); // flags replace what the file listed
        fresh[row - table] = true;
    }
    return status ? status : set_value(o, row, value, err);
}

static enum hg_status apply_flag(
    struct hg_options *o, struct flags *f, bool only_extra, bool *fresh, struct hg_error *err)
{
    const char *arg = f->argv[f->at];
    if (strncmp(arg, "--", 2) != 0 || !arg[2])
        return hg_error_set(err, HG_E_INVAL, arg, NULL, "unexpected argument; see --help");
    char name[64];
    const char *equals = strchr(arg, '=');
    size_t length = equals ? (size_t)(equals - arg) - 2 : strlen(arg + 2);
    snprintf(name, sizeof name, "%.*s", (int)length, arg + 2);
    f->inline_value = equals ? equals + 1 : NULL;
    enum hg_status status = apply_extra(o, f, name, err);
    if (status != HG_E_NOTFOUND)
        return status;
    const struct option *row = find_row(name, strlen(name));
    if (!row && strncmp(name, "no-", 3) == 0 && !equals) {
        row = find_row(name + 3, strlen(name + 3));
        f->inline_value = "false";
        row = row && row->kind == BOOL ? row : NULL;
    }
    if (!row)
        return hg_error_set(err, HG_E_INVAL, arg, NULL, "unknown option; see --help");
    struct hg_options scratch = {0}; // the first pass only looks for --config
    status = apply_row(only_extra ? &scratch : o, f, row, fresh, err);
    hg_options_finish(&scratch);
    if (status && err && !err->what[0])
        snprintf(err->what, sizeof err->what, "--%s", row->name);
    return status;
}

static enum hg_status apply_flags(
    struct hg_options *o, int argc, char *const *argv, bool only_extra, struct hg_error *err)
{
    bool fresh[TABLE_COUNT] = {0};
    struct flags f = {.argc = argc, .argv = argv};
    for (f.at = 1; f.at < argc; f.at++) {
        enum hg_status status = apply_flag(o, &f, only_extra, fresh, err);
        if (status)
            return status;
    }
    return HG_OK;
}

enum hg_status hg_options_parse(
    int argc, char *const *argv, struct hg_options *out, struct hg_error *err)
{
    struct hg_options o = {0};
    enum hg_status status = apply_flags(&o, argc, argv, true, err);
    if (!status)
        status = set_defaults(&o, err);
    if (!status && o.config)
        status = read_file(&o, o.config, err);
    if (!status)
        status = apply_flags(&o, argc, argv, false, err);
    if (status)
        hg_options_finish(&o);
    *out = o;
    return status;
}

void hg_options_finish(struct hg_options *o)
{
    for (size_t i = 0; i < TABLE_COUNT; i++) {
        if (table[i].name && (table[i].kind == TEXT || table[i].kind == CHOICE))
            hg_free(*(char **)member(o, &table[i]));
        if (table[i].name && table[i].kind == LIST)
            clear_list(member(o, &table[i]));
    }
    hg_free(o->config);
    hg_free(o->docs);
    *o = (struct hg_options){0};
}

// ---- reload -------------------------------------------------------------------------------------

static size_t value_size(enum kind kind)
{
    switch (kind) {
    case TEXT:
    case CHOICE:
        return sizeof(char *);
    case LIST:
        return sizeof(struct hg_text_list);
    case COUNT:
        return sizeof(uint32_t);
    case BOOL:
        return sizeof(bool);
    default:
        return sizeof(uint64_t);
    }
}

static bool same_text(const char *a, const char *b)
{
    return strcmp(a ? a : "", b ? b : "") == 0;
}

static bool same_value(
    const struct hg_options *a, const struct hg_options *b, const struct option *row)
{
    const void *x = member(a, row), *y = member(b, row);
    if (row->kind == TEXT || row->kind == CHOICE)
        return same_text(*(char *const *)x, *(char *const *)y);
    if (row->kind != LIST)
        return memcmp(x, y, value_size(row->kind)) == 0;
    const struct hg_text_list *p = x, *q = y;
    for (size_t i = 0; i < p->count && p->count == q->count; i++)
        if (!same_text(p->items[i], q->items[i]))
            return false;
    return p->count == q->count;
}

static void swap_values(struct hg_options *a, struct hg_options *b, const struct option *row)
{
    unsigned char hold[sizeof(struct hg_text_list)];
    size_t size = value_size(row->kind);
    memcpy(hold, member(a, row), size);
    memcpy(member(a, row), member(b, row), size);
    memcpy(member(b, row), hold, size);
}

size_t hg_options_reload(
    struct hg_options *into, struct hg_options *from, char *names, size_t names_size)
{
    size_t differ = 0, used = 0;
    if (names_size)
        names[0] = 0;
    for (size_t i = 0; i < TABLE_COUNT; i++) {
        const struct option *row = &table[i];
        if (!row->name || same_value(into, from, row))
            continue;
        if (row->reload == LIVE) {
            swap_values(into, from, row);
            continue;
        }
        differ++;
        if (used < names_size)
            used += (size_t)snprintf(
                names + used, names_size - used, "%s%s", used ? " " : "", row->name);
    }
    hg_options_finish(from);
    return differ;
}

// ---- documentation ------------------------------------------------------------------------------

static const char *unit(const struct option *row)
{
    return row->kind == MIB ? " MiB" : row->kind == SECONDS ? " s" : "";
}

static bool has_range(const struct option *row)
{
    return row->kind == COUNT || row->kind == MIB || row->kind == SECONDS;
}

// Prints words wrapped to 80 columns behind `indent` spaces.
static void print_wrapped(FILE *file, int indent, const char *text)
{
    int column = 0;
    while (*text) {
        int length = (int)strcspn(text, " ");
        if (column == 0 || column + 1 + length > 80) {
            fprintf(file, "%s%*s", column ? "\n" : "", indent, "");
            column = indent;
        } else {
            fputc(' ', file);
            column++;
        }
        fprintf(file, "%.*s", length, text);
        column += length;
        text += length + (text[length] == ' ');
    }
    fputc('\n', file);
}

void hg_options_print_help(FILE *file)
{
    fprintf(file, "heliod - serve Heliograph scenes to clients\n\n"
                  "Usage: heliod [--name VALUE]...\n");
    for (size_t i = 0; i < TABLE_COUNT; i++) {
        const struct option *row = &table[i];
        if (row->group) {
            fprintf(file, "\n%s:\n", row->group);
            continue;
        }
        fprintf(file, "  --%s%s%s\n", row->name, *row->metavar ? " " : "", row->metavar);
        print_wrapped(file, 6, row->help);
        if (*row->def)
            fprintf(file, "      Default: %s%s\n", row->def, unit(row));
    }
    fprintf(file, "\nOther:\n");
    for (size_t i = 0; i < sizeof extra / sizeof *extra; i++) {
        fprintf(
            file, "  --%s%s%s\n", extra[i].name, *extra[i].metavar ? " " : "", extra[i].metavar);
        print_wrapped(file, 6, extra[i].help);
    }
}

static const char markdown_head[] =
    "# Configuration of heliod\n\n"
    "<!-- Made from server/broker/options.def by `heliod --print-docs markdown`; "
    "do not edit. -->\n\n"
    "Every option can be given on the command line (`--name VALUE`, `--name=VALUE`; switches "
    "`--name` and `--no-name`) and in a file (`--config FILE`; one `name = value` per line, `#` "
    "starts a comment line, lists by repeating the line). Flags override the file; a list given "
    "by flags replaces the file's. `heliod --check-config` checks all of it and names file and "
    "line of the first fault. SIGHUP reads the file and the tokens again and applies the options "
    "marked *live*; a bad file changes nothing and is reported in the log.\n";

static const char token_text[] =
    "\n## Tokens\n\n"
    "```\n# TOKEN  ROLE  [NAME]  [KEY=VALUE...]\n"
    "sha256:9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08  edit  ci-runner\n"
    "sha256:60303ae22b998861bce3b28f33eec1be758a213c86c93c076dbe9f558c11c752  view  guests"
    "  expires=2027-06-30  scenes=showroom-*  sessions=20\n```\n\n"
    "`view` may open scenes and views and ask; `edit` may also change scenes; `admin` may also "
    "list sessions. Tokens have 8 to 256 characters without spaces; `heliod --hash-token` reads "
    "one "
    "and prints the word that stands for it. A token stands there once. It may also stand there as "
    "it is; the daemon "
    "warns about it, and about a file that others than its user may read.\n\n"
    "| key | |\n|---|---|\n"
    "| `tenant=NAME` | Whose scenes and worker it gets, in place of NAME: tokens of one tenant "
    "share them, and this is how a token is let into another's scenes. Without a name, too, it is "
    "a tenant of its own. |\n"
    "| `expires=YYYY-MM-DD[Thh:mm:ssZ]` | From then on (UTC) it is unknown, and its sessions end. "
    "|\n"
    "| `scenes=PATTERN` | It opens scenes whose names match only (`*`, `?`, `[...]`), and scenes "
    "without a name, which are a session's own. |\n"
    "| `roots=FOLDER[:FOLDER...]` | It loads files of the daemon's machine from below these "
    "folders only, and under asset roots. Absolute paths without spaces. Files beside them answer "
    "as files outside of the asset roots do. |\n"
    "| `weight=COUNT` | 1 to 10000, usually 100: its tenant's part of cores and memory, beside "
    "other tenants that have workers; in a shared worker, of its time. |\n"
    "| `sessions=COUNT` | Open at a time, in place of `max-sessions-per-token`. |\n"
    "| `rate=COUNT` | Messages per second of a session, in place of `max-rate`. |\n"
    "| `pixels=COUNT` | Pixels of frames per second of its sessions together, in place of "
    "`max-pixel-rate`. |\n"
    "| `tickets=COUNT` | Join tickets that it may have at a time, also with the role `view`. "
    "|\n\n"
    "On SIGHUP the sessions of tokens that are no longer there, or have another role, end. Clients "
    "on a unix socket that run as the daemon's own user need no token (they are `admin`) unless "
    "`require-token` is set.\n";

// Read by renderer/debug_environment.c.
static const char environment_text[] =
    "\n## Environment of workers\n\n"
    "`HELIO_WORKER` is the worker's program, see above; `HELIO_LOADER` what workers read foreign "
    "formats with, else ../libexec/helio-loader beside the worker. For people who look into a "
    "frame, workers "
    "of "
    "a daemon, private workers and `helio-bench` take these; pictures stay the same:\n\n"
    "| variable | |\n|---|---|\n"
    "| `HELIO_CULLING=off` | Everything is drawn, seen or not. |\n"
    "| `HELIO_RASTER=device` | On CPU devices, too, the device draws every triangle. |\n"
    "| `HELIO_PREFETCH=off` | No texture page is read before it is missing. |\n"
    "| `HELIO_GPU_TABLES=off` | Shaders reach every table by address, as on GPUs. |\n"
    "| `HELIO_GPU_OPTIMISE=on`, `off` | Shaders are made shorter before the driver compiles them; "
    "default on CPU devices. |\n"
    "| `HELIO_DARK=on`, `off` | Tiles that no light reaches are shaded without lights everywhere, "
    "nowhere; default where it pays. |\n"
    "| `HELIO_IRRADIANCE_RAYS=off` | Pictures in motion have the light of probes as it is, and "
    "rough "
    "surfaces mirror what these see. |\n";

void hg_options_print_markdown(FILE *file)
{
    fputs(markdown_head, file);
    for (size_t i = 0; i < TABLE_COUNT; i++) {
        const struct option *row = &table[i];
        if (row->group) {
            fprintf(file,
                "\n## %s\n\n| option | default | range | applied | |\n|---|---|---|---|---|\n",
                row->group);
            continue;
        }
        fprintf(file, "| `%s%s%s` | ", row->name, *row->metavar ? " " : "", row->metavar);
        fprintf(file, *row->def ? "%s%s | " : "%s%s| ", row->def, *row->def ? unit(row) : "");
        if (has_range(row))
            fprintf(file, "%.10g–%.10g%s | ", row->min, row->max, unit(row));
        else
            fprintf(file, "%s | ",
                row->kind == LIST   ? "several"
                : row->kind == BOOL ? "true, false"
                                    : "");
        fprintf(file, "%s | %s |\n", row->reload == LIVE ? "live" : "start", row->help);
    }
    fprintf(file, "\n## Flags only\n\n| flag | |\n|---|---|\n");
    for (size_t i = 0; i < sizeof extra / sizeof *extra; i++)
        fprintf(file, "| `--%s%s%s` | %s |\n", extra[i].name, *extra[i].metavar ? " " : "",
            extra[i].metavar, extra[i].help);
    fputs(token_text, file);
    fputs(environment_text, file);
}

static void print_roff(FILE *file, const char *text)
{
    for (; *text; text++) {
        if (*text == '-' || *text == '\\')
            fputc('\\', file);
        if (*text == '\\')
            fputc('e', file);
        else
            fputc(*text, file);
    }
}

static void print_man_option(FILE *file, const char *name, const char *metavar)
{
    fputs(".TP\n\\fB\\-\\-", file);
    print_roff(file, name);
    fprintf(file, "\\fR%s\\fI", *metavar ? " " : "");
    print_roff(file, metavar);
    fputs("\\fR\n", file);
}

static const char man_tail[] =
    ".SH SIGNALS\n"
    ".TP\n\\fBSIGTERM\\fR, \\fBSIGINT\\fR\nDrain: accept no connections, finish what is under way, "
    "exit with 0. A second one exits at once.\n"
    ".TP\n\\fBSIGHUP\\fR\nRead the configuration file and the tokens again; a bad file changes "
    "nothing.\n"
    ".SH EXIT STATUS\n0 done, 2 bad options or configuration, 4 cannot listen or start the worker. "
    "\\fB\\-\\-device\\-info\\fR exits as the worker does.\n"
    ".SH ENVIRONMENT\n\\fBHELIO_WORKER\\fR the worker's program; \\fBLISTEN_FDS\\fR, "
    "\\fBNOTIFY_SOCKET\\fR, \\fBWATCHDOG_USEC\\fR as systemd sets them.\n"
    ".SH SEE ALSO\nhelio(1)\n";

void hg_options_print_man(FILE *file)
{
    fputs(".TH HELIOD 8 \"\" \"Heliograph\"\n.SH NAME\nheliod \\- serve Heliograph scenes to "
          "clients\n.SH SYNOPSIS\n.B heliod\n[\\-\\-name VALUE]...\n",
        file);
    for (size_t i = 0; i < TABLE_COUNT; i++) {
        const struct option *row = &table[i];
        if (row->group) {
            fputs(".SH ", file);
            for (const char *c = row->group; *c; c++)
                fputc(toupper((unsigned char)*c), file);
            fputc('\n', file);
            continue;
        }
        print_man_option(file, row->name, row->metavar);
        print_roff(file, row->help);
        if (*row->def) {
            fputs(" Default: ", file);
            print_roff(file, row->def);
            fputs(unit(row), file);
            fputc('.', file);
        }
        fputc('\n', file);
    }
    fputs(".SH OTHER\n", file);
    for (size_t i = 0; i < sizeof extra / sizeof *extra; i++) {
        print_man_option(file, extra[i].name, extra[i].metavar);
        print_roff(file, extra[i].help);
        fputc('\n', file);
    }
    fputs(man_tail, file);
}
