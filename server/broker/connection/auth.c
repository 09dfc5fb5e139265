#include "server/broker/connection/auth.h"

#include <errno.h>
#include <openssl/crypto.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#include "base/alloc.h"
#include "base/file.h"
#include "base/sha256.h"
#include "base/utf8.h"

enum { FILE_LIMIT_BYTES = 4 << 20 };

static const char blanks[] = " \t\r";

// Cuts the next word off *text; NULL at the end of the line.
static char *next_word(char **text)
{
    char *word = *text + strspn(*text, blanks);
    size_t length = strcspn(word, blanks);
    if (!length)
        return NULL;
    *text = word + length;
    if (**text)
        *(*text)++ = 0;
    return word;
}

// ---- what a token allows ------------------------------------------------------------------------

static bool parse_date(const char *text, int64_t *out)
{
    struct tm tm = {0};
    const char *end = strptime(text, "%Y-%m-%d", &tm);
    if (end && *end == 'T')
        end = strptime(end, "T%H:%M:%SZ", &tm);
    time_t time = end && !*end ? timegm(&tm) : 0;
    *out = time;
    return time > 0;
}

static bool parse_count(const char *text, uint32_t *out)
{
    char *end;
    errno = 0;
    unsigned long value = strtoul(text, &end, 10);
    *out = (uint32_t)value;
    return text[0] >= '0' && text[0] <= '9' && !*end && !errno && value && value <= UINT32_MAX;
}

static bool parse_pattern(const char *text, char *out, size_t size)
{
    return *text && (size_t)snprintf(out, size, "%s", text) < size;
}

// Folders from the root of the file system on.
static bool parse_roots(const char *text, char *out, size_t size)
{
    for (const char *at = text; at; at = strchr(at, ':') ? strchr(at, ':') + 1 : NULL)
        if (*at != '/')
            return false;
    return parse_pattern(text, out, size);
}

static bool parse_scope(char *word, struct hg_token *out)
{
    struct hg_token_scope *scope = &out->scope;
    char *value = strchr(word, '=');
    *value++ = 0;
    if (strcmp(word, "tenant") == 0)
        return parse_pattern(value, out->tenant, sizeof out->tenant);
    if (strcmp(word, "expires") == 0)
        return parse_date(value, &scope->expires_s);
    if (strcmp(word, "scenes") == 0)
        return parse_pattern(value, scope->scenes, sizeof scope->scenes);
    if (strcmp(word, "roots") == 0)
        return parse_roots(value, scope->roots, sizeof scope->roots);
    if (strcmp(word, "weight") == 0)
        return parse_count(value, &scope->weight) && scope->weight <= HG_TOKEN_WEIGHT_MAX;
    if (strcmp(word, "pixels") == 0)
        return parse_count(value, &scope->max_pixels);
    if (strcmp(word, "tickets") == 0)
        return parse_count(value, &scope->max_tickets);
    if (strcmp(word, "sessions") == 0)
        return parse_count(value, &scope->max_sessions);
    return strcmp(word, "rate") == 0 && parse_count(value, &scope->max_rate);
}

// What a key takes, or which keys there are.
static enum hg_status refuse_scope(const char *key, const char *value, struct hg_error *err)
{
    static const struct {
        const char *key, *takes;
    } keys[] = {{"tenant", "a name"}, {"expires", "YYYY-MM-DD[Thh:mm:ssZ]"},
        {"scenes", "a pattern of names"}, {"roots", "/FOLDER[:/FOLDER...]"},
        {"weight", "1 to 10000"}, {"sessions", "a number from 1 on"},
        {"rate", "a number from 1 on"}, {"pixels", "a number from 1 on"},
        {"tickets", "a number from 1 on"}};
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
        if (strcmp(key, keys[i].key) == 0)
            return hg_error_set(err, HG_E_INVAL, NULL, NULL, "%s= takes %s, not '%.80s'", key,
                keys[i].takes, value);
    return hg_error_set(err, HG_E_INVAL, NULL, NULL,
        "'%.40s' is no key; there are tenant, expires, scenes, roots, weight, sessions, rate, "
        "pixels and tickets",
        key);
}

// ---- lines --------------------------------------------------------------------------------------

enum hg_status hg_token_hash(struct hgp_str token, uint8_t out[32])
{
    return hg_sha256(token.data ? token.data : "", token.size, out);
}

enum hg_status hg_token_subject_hash(const char *subject, uint8_t out[32])
{
    enum hg_status status = hg_sha256(subject, strlen(subject), out);
    for (int i = 0; i < 32; i++) // what no token has as its hash
        out[i] ^= 0xff;
    return status;
}

static enum hg_status parse_token(
    char *word, struct hg_token *out, bool *plain, struct hg_error *err)
{
    static const char prefix[] = "sha256:";
    size_t length = strlen(word);
    *plain = false;
    if (strncmp(word, "subject:", 8) == 0 && word[8])
        return hg_token_subject_hash(word + 8, out->hash);
    *plain = strncmp(word, prefix, sizeof prefix - 1) != 0;
    if (!*plain)
        return hg_sha256_parse(word + sizeof prefix - 1, sizeof out->hash, out->hash)
                   ? HG_OK
                   : hg_error_set(
                         err, HG_E_INVAL, NULL, NULL, "expected 64 digits 0-9 a-f after 'sha256:'");
    if (length < HG_TOKEN_MIN || length > HG_TOKEN_MAX)
        return hg_error_set(err, HG_E_INVAL, NULL, NULL, "a token has %d to %d characters",
            HG_TOKEN_MIN, HG_TOKEN_MAX);
    enum hg_status status = hg_sha256(word, length, out->hash);
    OPENSSL_cleanse(word, length);
    return status;
}

// A token without a name is a tenant of its own.
static void name_tenant(struct hg_token *out)
{
    char hex[HG_SHA256_HEX];
    hg_sha256_hex(out->hash, hex);
    snprintf(out->tenant, sizeof out->tenant, "token:%.16s", hex);
}

static void take_name(struct hg_token *out, const char *name)
{
    snprintf(out->name, sizeof out->name, "%s", name);
    snprintf(out->tenant, sizeof out->tenant, "%s", name);
}

static enum hg_status parse_line(
    char *line, struct hg_token *out, bool *plain, struct hg_error *err)
{
    char *token = next_word(&line), *role = token ? next_word(&line) : NULL, *word;
    *out = (struct hg_token){0};
    if (!token || *token == '#')
        return HG_OK;
    enum hg_status status = parse_token(token, out, plain, err);
    if (status)
        return status;
    uint32_t value = 0;
    if (!role || !hgp_enum_value("role", role, &value) || value == HGP_role_NONE)
        return hg_error_set(
            err, HG_E_INVAL, NULL, NULL, "expected 'TOKEN ROLE [NAME]', ROLE view, edit or admin");
    snprintf(out->name, sizeof out->name, "%s", role);
    name_tenant(out);
    for (int i = 0; (word = next_word(&line)); i++) {
        bool is_name = i == 0 && !strchr(word, '=');
        if (is_name)
            take_name(out, word);
        else if (!strchr(word, '='))
            return hg_error_set(err, HG_E_INVAL, NULL, NULL, "a name has no spaces");
        else if (!parse_scope(word, out)) // which has cut it
            return refuse_scope(word, word + strlen(word) + 1, err);
    }
    out->role = (enum hgp_role)value;
    hg_utf8_clean(out->name); // it is sent to the client
    return HG_OK;
}

static enum hg_status add_token(struct hg_tokens *tokens, const struct hg_token *token)
{
    if (hg_grow(&tokens->items, &tokens->capacity, tokens->count + 1, sizeof *tokens->items))
        return HG_E_NOMEM;
    tokens->items[tokens->count++] = *token;
    return HG_OK;
}

static enum hg_status parse_lines(
    char *text, const char *path, struct hg_tokens *out, struct hg_error *err)
{
    unsigned number = 1;
    for (char *next; text; text = next, number++) {
        struct hg_token token;
        next = strchr(text, '\n');
        if (next)
            *next++ = 0;
        bool plain = false;
        enum hg_status status = parse_line(text, &token, &plain, err);
        if (!status && token.role != HGP_role_NONE) {
            out->plain += plain;
            token.line = number;
            status = add_token(out, &token);
        }
        if (!status)
            continue;
        if (err) {
            snprintf(err->what, sizeof err->what, "%s", path);
            snprintf(err->where, sizeof err->where, "line %u", number);
        }
        return status;
    }
    return HG_OK;
}

static int compare_tokens(const void *a, const void *b)
{
    const struct hg_token *x = *(const struct hg_token *const *)a;
    const struct hg_token *y = *(const struct hg_token *const *)b;
    const int order = memcmp(x->hash, y->hash, sizeof x->hash);
    return order ? order : x->line < y->line ? -1 : 1;
}

// A token that stands there twice would have what one of its lines says, and nobody sees which.
static enum hg_status check_unique(
    const struct hg_tokens *tokens, const char *path, struct hg_error *err)
{
    char where[32];
    enum hg_status status = HG_OK;
    const struct hg_token **sorted = hg_calloc(tokens->count + 1, sizeof *sorted);
    if (!sorted)
        return HG_E_NOMEM;
    for (size_t i = 0; i < tokens->count; i++)
        sorted[i] = &tokens->items[i];
    qsort(sorted, tokens->count, sizeof *sorted, compare_tokens);
    for (size_t i = 1; i < tokens->count && !status; i++) {
        if (memcmp(sorted[i - 1]->hash, sorted[i]->hash, sizeof sorted[i]->hash) != 0)
            continue;
        snprintf(where, sizeof where, "line %u", sorted[i]->line);
        status = hg_error_set(err, HG_E_INVAL, path, where,
            "the token of line %u again; only one of them can count", sorted[i - 1]->line);
    }
    hg_free(sorted);
    return status;
}

enum hg_status hg_tokens_read(const char *path, struct hg_tokens *out, struct hg_error *err)
{
    uint8_t *data;
    size_t size;
    struct stat st;
    *out = (struct hg_tokens){0};
    enum hg_status status = hg_file_read(path, FILE_LIMIT_BYTES, &data, &size, err);
    if (status)
        return status;
    struct hg_tokens tokens = {0};
    tokens.exposed = stat(path, &st) == 0 && (st.st_mode & (S_IRWXG | S_IRWXO));
    status = parse_lines((char *)data, path, &tokens, err);
    OPENSSL_cleanse(data, size);
    hg_free(data);
    if (!status)
        status = check_unique(&tokens, path, err);
    if (status)
        hg_tokens_finish(&tokens);
    else
        *out = tokens;
    return status;
}

const struct hg_token *hg_tokens_find(
    const struct hg_tokens *tokens, const uint8_t hash[32], int64_t now_s)
{
    const struct hg_token *found = NULL;
    for (size_t i = 0; i < tokens->count; i++)
        if (CRYPTO_memcmp(hash, tokens->items[i].hash, 32) == 0)
            found = &tokens->items[i];
    return found && (!found->scope.expires_s || now_s < found->scope.expires_s) ? found : NULL;
}

void hg_tokens_finish(struct hg_tokens *tokens)
{
    if (tokens->items)
        OPENSSL_cleanse(tokens->items, tokens->count * sizeof *tokens->items);
    hg_free(tokens->items);
    *tokens = (struct hg_tokens){0};
}
