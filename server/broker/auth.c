#include "server/broker/auth.h"

#include <openssl/crypto.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "base/alloc.h"
#include "base/file.h"
#include "base/sha256.h"
#include "base/utf8.h"

enum { FILE_LIMIT_BYTES = 4 << 20, TOKEN_MIN = 8, TOKEN_MAX = 256, MINUTE_S = 60 };

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

static enum hg_status parse_line(char *line, struct hg_token *out, struct hg_error *err)
{
    char *token = next_word(&line), *role = token ? next_word(&line) : NULL, *name = NULL;
    *out = (struct hg_token){0};
    if (!token || *token == '#')
        return HG_OK;
    uint32_t value = 0;
    size_t length = strlen(token);
    if (length < TOKEN_MIN || length > TOKEN_MAX)
        return hg_error_set(
            err, HG_E_INVAL, NULL, NULL, "a token has %d to %d characters", TOKEN_MIN, TOKEN_MAX);
    if (!role || !hgp_enum_value("role", role, &value) || value == HGP_role_NONE)
        return hg_error_set(
            err, HG_E_INVAL, NULL, NULL, "expected 'TOKEN ROLE [NAME]', ROLE view, edit or admin");
    name = next_word(&line);
    if (name && next_word(&line))
        return hg_error_set(err, HG_E_INVAL, NULL, NULL, "a name has no spaces");
    out->role = (enum hgp_role)value;
    snprintf(out->name, sizeof out->name, "%s", name ? name : role);
    hg_utf8_clean(out->name); // it is sent to the client
    enum hg_status status = hg_sha256(token, length, out->hash);
    OPENSSL_cleanse(token, length);
    return status;
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
        enum hg_status status = parse_line(text, &token, err);
        if (!status && token.role != HGP_role_NONE)
            status = add_token(out, &token);
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
    if (status)
        hg_tokens_finish(&tokens);
    else
        *out = tokens;
    return status;
}

const struct hg_token *hg_tokens_find(const struct hg_tokens *tokens, struct hgp_str token)
{
    uint8_t hash[32];
    const struct hg_token *found = NULL;
    if (hg_sha256(token.data ? token.data : "", token.size, hash))
        return NULL;
    for (size_t i = 0; i < tokens->count; i++)
        if (CRYPTO_memcmp(hash, tokens->items[i].hash, sizeof hash) == 0)
            found = &tokens->items[i];
    return found;
}

void hg_tokens_finish(struct hg_tokens *tokens)
{
    if (tokens->items)
        OPENSSL_cleanse(tokens->items, tokens->count * sizeof *tokens->items);
    hg_free(tokens->items);
    *tokens = (struct hg_tokens){0};
}

// ---- guessing -----------------------------------------------------------------------------------

static bool in_window(const struct hg_guard_entry *entry, uint64_t now_ns)
{
    return entry->failures && now_ns - entry->window_ns < MINUTE_S * 1000000000ull;
}

bool hg_guard_is_blocked(
    const struct hg_guard *guard, const char *address, uint32_t limit, uint64_t now_ns)
{
    for (int i = 0; i < HG_GUARD_ENTRIES; i++) {
        const struct hg_guard_entry *entry = &guard->entries[i];
        if (strcmp(entry->address, address) == 0)
            return in_window(entry, now_ns) && entry->failures >= limit;
    }
    return false;
}

void hg_guard_count_failure(struct hg_guard *guard, const char *address, uint64_t now_ns)
{
    struct hg_guard_entry *entry = NULL, *oldest = &guard->entries[0];
    for (int i = 0; i < HG_GUARD_ENTRIES && !entry; i++) {
        if (strcmp(guard->entries[i].address, address) == 0)
            entry = &guard->entries[i];
        if (guard->entries[i].window_ns < oldest->window_ns)
            oldest = &guard->entries[i];
    }
    if (!entry) {
        entry = oldest;
        *entry = (struct hg_guard_entry){0};
        snprintf(entry->address, sizeof entry->address, "%s", address);
    }
    if (!in_window(entry, now_ns)) {
        entry->failures = 0;
        entry->window_ns = now_ns;
    }
    entry->failures++;
}
