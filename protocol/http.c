#include "protocol/http.h"

#include <string.h>
#include <strings.h>

static enum hg_status refuse(
    struct hg_http_head *out, enum hg_status status, unsigned answer, const char *reason)
{
    *out = (struct hg_http_head){.status = answer, .reason = reason};
    return status;
}

// ---- characters ---------------------------------------------------------------------------------

// tchar of RFC 9110, 5.6.2.
static bool is_token_char(unsigned char c)
{
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
           (c && strchr("!#$%&'*+-.^_`|~", c));
}

// Of a field's value: visible characters, spaces, tabs, and bytes above ASCII.
static bool is_value_char(unsigned char c)
{
    return c == '\t' || (c >= ' ' && c != 0x7f);
}

static bool is_space(char c)
{
    return c == ' ' || c == '\t';
}

static bool are_token_chars(struct hg_http_text text)
{
    for (size_t i = 0; i < text.size; i++)
        if (!is_token_char((unsigned char)text.data[i]))
            return false;
    return true;
}

bool hg_http_is(struct hg_http_text text, const char *other)
{
    return strlen(other) == text.size && memcmp(text.data, other, text.size) == 0;
}

bool hg_http_is_caseless(struct hg_http_text text, const char *other)
{
    return strlen(other) == text.size && strncasecmp(text.data, other, text.size) == 0;
}

bool hg_http_number(struct hg_http_text text, uint64_t most, uint64_t *out)
{
    uint64_t value = 0;
    *out = 0;
    for (size_t i = 0; i < text.size; i++) {
        unsigned digit = (unsigned)(text.data[i] - '0');
        if (digit > 9 || value > (most - digit) / 10)
            return false;
        value = value * 10 + digit;
    }
    *out = value;
    return text.size > 0 && value <= most;
}

// ---- lines --------------------------------------------------------------------------------------

// Takes a line without its CRLF. HG_E_AGAIN: it has no end yet; HG_E_FORMAT: an end without CR,
// a CR that ends nothing, or a NUL.
static enum hg_status next_line(struct hg_http_text *rest, struct hg_http_text *line)
{
    for (size_t i = 0; i < rest->size; i++) {
        const char c = rest->data[i];
        if (c == '\n' || c == 0)
            return HG_E_FORMAT;
        if (c != '\r')
            continue;
        if (i + 1 == rest->size)
            return HG_E_AGAIN;
        if (rest->data[i + 1] != '\n')
            return HG_E_FORMAT;
        *line = (struct hg_http_text){rest->data, i};
        rest->data += i + 2;
        rest->size -= i + 2;
        return HG_OK;
    }
    return HG_E_AGAIN;
}

// Takes what stands before the next space of a line.
static struct hg_http_text next_word(struct hg_http_text *line)
{
    const char *space = line->size ? memchr(line->data, ' ', line->size) : NULL;
    struct hg_http_text word = {line->data, space ? (size_t)(space - line->data) : line->size};
    size_t taken = word.size + (space != NULL);
    line->data += taken;
    line->size -= taken;
    return word;
}

static bool take_version(struct hg_http_text word, struct hg_http_head *out, bool *is_http)
{
    *is_http = word.size == 8 && memcmp(word.data, "HTTP/", 5) == 0 && word.data[6] == '.' &&
               word.data[5] >= '0' && word.data[5] <= '9' && word.data[7] >= '0' &&
               word.data[7] <= '9';
    out->minor = *is_http ? (unsigned)(word.data[7] - '0') : 0;
    return *is_http && word.data[5] == '1';
}

static bool take_field(struct hg_http_text line, struct hg_http_field *out)
{
    const char *colon = memchr(line.data, ':', line.size);
    if (!colon || colon == line.data)
        return false;
    out->name = (struct hg_http_text){line.data, (size_t)(colon - line.data)};
    struct hg_http_text value = {colon + 1, line.size - out->name.size - 1};
    while (value.size && is_space(value.data[0])) {
        value.data++;
        value.size--;
    }
    while (value.size && is_space(value.data[value.size - 1]))
        value.size--;
    out->value = value;
    for (size_t i = 0; i < value.size; i++)
        if (!is_value_char((unsigned char)value.data[i]))
            return false;
    return are_token_chars(out->name);
}

static enum hg_status fail_line(struct hg_http_head *out, enum hg_status status)
{
    return status == HG_E_AGAIN
               ? HG_E_AGAIN
               : refuse(out, HG_E_FORMAT, 400, "a line does not end with CR LF, or holds NUL");
}

// The fields and the empty line behind them.
static enum hg_status take_fields(struct hg_http_text *rest, struct hg_http_head *out)
{
    for (;;) {
        struct hg_http_text line;
        enum hg_status status = next_line(rest, &line);
        if (status)
            return fail_line(out, status);
        if (!line.size)
            return HG_OK;
        if (out->field_count == HG_HTTP_FIELDS)
            return refuse(out, HG_E_LIMIT, 431, "too many header fields");
        if (!take_field(line, &out->fields[out->field_count]))
            return refuse(out, HG_E_FORMAT, 400, "a header field is malformed");
        out->field_count++;
    }
}

// More than this never becomes a head, however it goes on.
static enum hg_status limit_head(struct hg_http_head *out, enum hg_status status, size_t size)
{
    if ((status == HG_E_AGAIN && size >= HG_HTTP_HEAD_BYTES) ||
        (status == HG_OK && out->bytes > HG_HTTP_HEAD_BYTES))
        return refuse(out, HG_E_LIMIT, 431, "the header fields are too large");
    return status;
}

// ---- requests -----------------------------------------------------------------------------------

// The origin form, or the path of an absolute one.
static bool split_target(struct hg_http_head *out)
{
    struct hg_http_text path = out->target;
    for (size_t i = 0; i < path.size; i++)
        if ((unsigned char)path.data[i] <= ' ' || (unsigned char)path.data[i] >= 0x7f)
            return false;
    if (path.size > 7 && strncasecmp(path.data, "http", 4) == 0) {
        const size_t scheme = path.data[4] == 's' || path.data[4] == 'S' ? 8 : 7;
        if (path.size <= scheme || memcmp(path.data + scheme - 3, "://", 3) != 0)
            return false;
        const char *slash = memchr(path.data + scheme, '/', path.size - scheme);
        path.size = slash ? path.size - (size_t)(slash - path.data) : 1;
        path.data = slash ? slash : "/";
    }
    if (!path.size || (path.data[0] != '/' && !hg_http_is(path, "*")))
        return false;
    const char *question = memchr(path.data, '?', path.size);
    out->path = path;
    if (question) {
        out->path.size = (size_t)(question - path.data);
        out->query = (struct hg_http_text){question + 1, path.size - out->path.size - 1};
    }
    return !memchr(path.data, '#', path.size);
}

static enum hg_status take_request_line(struct hg_http_text line, struct hg_http_head *out)
{
    bool is_http;
    out->method = next_word(&line);
    out->target = next_word(&line);
    const bool is_known = take_version(line, out, &is_http);
    if (!out->method.size || out->method.size > HG_HTTP_METHOD_BYTES ||
        !are_token_chars(out->method) || !out->target.size)
        return refuse(out, HG_E_FORMAT, 400, "the request line is malformed");
    if (out->target.size > HG_HTTP_TARGET_BYTES)
        return refuse(out, HG_E_LIMIT, 414, "the target is too long");
    if (!is_http)
        return refuse(out, HG_E_FORMAT, 400, "the request line names no version of HTTP");
    if (!is_known)
        return refuse(out, HG_E_VERSION, 505, "HTTP/1.1 and 1.0 are served");
    if (!split_target(out))
        return refuse(out, HG_E_FORMAT, 400, "the target is malformed");
    return HG_OK;
}

// A request line that has not ended: is what is there the start of one?
static enum hg_status check_begin(struct hg_http_text line, struct hg_http_head *out)
{
    struct hg_http_text method = next_word(&line);
    if (method.size && method.data[method.size - 1] == '\r')
        method.size--;
    if (method.size > HG_HTTP_METHOD_BYTES || !are_token_chars(method))
        return refuse(out, HG_E_FORMAT, 400, "this is no request of HTTP");
    if (line.size > HG_HTTP_TARGET_BYTES + sizeof " HTTP/1.1\r")
        return refuse(out, HG_E_LIMIT, 414, "the target is too long");
    return HG_E_AGAIN;
}

// One Host with HTTP/1.1, and no head of which the end of the body is in doubt.
static enum hg_status check_fields(struct hg_http_head *out)
{
    struct hg_http_text host, length;
    const size_t hosts = hg_http_find(out, "Host", &host);
    if (hosts > 1 || (!hosts && out->minor >= 1))
        return refuse(out, HG_E_FORMAT, 400, "a request has one Host");
    for (size_t i = 0; i < host.size; i++)
        if (is_space(host.data[i]) || strchr("/\\@,?#\"<>", host.data[i]))
            return refuse(out, HG_E_FORMAT, 400, "the Host is malformed");
    const size_t lengths = hg_http_find(out, "Content-Length", &length);
    uint64_t value;
    if (lengths > 1 || (lengths && !hg_http_number(length, UINT64_MAX, &value)))
        return refuse(out, HG_E_FORMAT, 400, "the Content-Length is malformed");
    if (lengths && hg_http_find(out, "Transfer-Encoding", &length))
        return refuse(
            out, HG_E_FORMAT, 400, "Content-Length and Transfer-Encoding exclude another");
    return HG_OK;
}

enum hg_status hg_http_request_parse(const void *data, size_t size, struct hg_http_head *out)
{
    struct hg_http_text rest = {data, size}, line;
    *out = (struct hg_http_head){0};
    enum hg_status status = next_line(&rest, &line);
    if (!status && !line.size)
        status = next_line(&rest, &line); // RFC 9112, 2.2
    if (status == HG_E_AGAIN) {
        status = check_begin(rest, out);
        return limit_head(out, status, size);
    }
    if (status)
        return fail_line(out, status);
    status = take_request_line(line, out);
    if (!status)
        status = take_fields(&rest, out);
    if (!status) {
        out->bytes = size - rest.size;
        status = check_fields(out);
    }
    return limit_head(out, status, size);
}

// ---- responses ----------------------------------------------------------------------------------

enum hg_status hg_http_response_parse(const void *data, size_t size, struct hg_http_head *out)
{
    struct hg_http_text rest = {data, size}, line;
    uint64_t code = 0;
    bool is_http;
    *out = (struct hg_http_head){0};
    enum hg_status status = next_line(&rest, &line);
    if (status)
        return limit_head(out, fail_line(out, status), size);
    const bool is_known = take_version(next_word(&line), out, &is_http);
    if (!is_http || !hg_http_number(next_word(&line), 999, &code) || code < 100)
        return refuse(out, HG_E_FORMAT, 0, "the status line is malformed");
    if (!is_known)
        return refuse(out, HG_E_VERSION, 0, "the version of HTTP is not 1.x");
    out->status = (unsigned)code;
    status = take_fields(&rest, out);
    if (!status)
        out->bytes = size - rest.size;
    return limit_head(out, status, size);
}

// ---- fields -------------------------------------------------------------------------------------

size_t hg_http_find(const struct hg_http_head *head, const char *name, struct hg_http_text *value)
{
    size_t count = 0;
    *value = (struct hg_http_text){"", 0};
    for (size_t i = 0; i < head->field_count; i++)
        if (hg_http_is_caseless(head->fields[i].name, name) && count++ == 0)
            *value = head->fields[i].value;
    return count;
}

static bool has_element(struct hg_http_text list, const char *token)
{
    while (list.size) {
        const char *comma = memchr(list.data, ',', list.size);
        struct hg_http_text word = {list.data, comma ? (size_t)(comma - list.data) : list.size};
        list.data += word.size + (comma != NULL);
        list.size -= word.size + (comma != NULL);
        while (word.size && is_space(word.data[0])) {
            word.data++;
            word.size--;
        }
        while (word.size && is_space(word.data[word.size - 1]))
            word.size--;
        if (hg_http_is_caseless(word, token))
            return true;
    }
    return false;
}

bool hg_http_lists(const struct hg_http_head *head, const char *name, const char *token)
{
    for (size_t i = 0; i < head->field_count; i++)
        if (hg_http_is_caseless(head->fields[i].name, name) &&
            has_element(head->fields[i].value, token))
            return true;
    return false;
}
