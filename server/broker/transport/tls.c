#include "server/broker/transport/tls.h"

#include <errno.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>
#include <time.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/file.h"
#include "base/log.h"
#include "server/broker/metrics/counters.h"

enum {
    RECORD_BYTES = 16384,
    TICKET_KEY_BYTES = 80,
    CLIENT_CA_BYTES = 16 << 20,
    FAULT_BYTES = 320,
    SOON_S = 7 * 86400
};

struct tls {
    struct hg_transport below;
    SSL *ssl;
    uint8_t *out; // records that the socket has not taken
    size_t out_sent, out_size, out_capacity;
    bool open;   // the handshake is done
    bool failed; // SSL_shutdown must not be called any more
    char *fault; // what is wrong with the client's certificate, or why the handshake failed
};

// ---- what is below, for OpenSSL -----------------------------------------------------------------

static enum hg_status flush_records(struct tls *tls)
{
    while (tls->out_sent < tls->out_size) {
        size_t sent;
        const struct iovec part = {tls->out + tls->out_sent, tls->out_size - tls->out_sent};
        enum hg_status status = tls->below.class->write(&tls->below, &part, 1, &sent);
        if (status)
            return status;
        tls->out_sent += sent;
    }
    hg_free(tls->out);
    tls->out = NULL;
    tls->out_sent = tls->out_size = tls->out_capacity = 0;
    return HG_OK;
}

static int bio_write(BIO *bio, const char *data, int size)
{
    struct tls *tls = BIO_get_data(bio);
    size_t sent = 0, rest;
    BIO_clear_retry_flags(bio);
    if (size <= 0)
        return 0;
    if (tls->out_sent == tls->out_size) {
        const struct iovec part = {(char *)data, (size_t)size};
        enum hg_status status = tls->below.class->write(&tls->below, &part, 1, &sent);
        if (status && status != HG_E_AGAIN)
            return -1;
    }
    rest = (size_t)size - sent;
    if (!rest)
        return size;
    if (hg_grow(&tls->out, &tls->out_capacity, tls->out_size + rest, 1))
        return -1;
    memcpy(tls->out + tls->out_size, data + sent, rest);
    tls->out_size += rest;
    return size;
}

static int bio_read(BIO *bio, char *data, int size)
{
    struct tls *tls = BIO_get_data(bio);
    size_t got;
    BIO_clear_retry_flags(bio);
    if (size <= 0)
        return 0;
    enum hg_status status = tls->below.class->read(&tls->below, data, (size_t)size, &got);
    if (!status)
        return (int)got;
    if (status == HG_E_AGAIN)
        BIO_set_retry_read(bio);
    return status == HG_E_CLOSED ? 0 : -1;
}

static long bio_control(BIO *bio, int command, long number, void *pointer)
{
    (void)bio;
    (void)number;
    (void)pointer;
    return command == BIO_CTRL_FLUSH;
}

// One for the process; never freed.
static BIO_METHOD *bio_method(void)
{
    static BIO_METHOD *method;
    if (!method && (method = BIO_meth_new(BIO_TYPE_SOURCE_SINK | BIO_get_new_index(), "hgp"))) {
        BIO_meth_set_write(method, bio_write);
        BIO_meth_set_read(method, bio_read);
        BIO_meth_set_ctrl(method, bio_control);
    }
    return method;
}

// ---- reading ------------------------------------------------------------------------------------

// The name in a certificate that one of the client authorities has signed.
static void take_subject(const struct hg_transport *t, struct tls *tls)
{
    X509 *certificate = SSL_get1_peer_certificate(tls->ssl);
    X509_NAME *name = certificate ? X509_get_subject_name(certificate) : NULL;
    int at = name ? X509_NAME_get_index_by_NID(name, NID_commonName, -1) : -1;
    unsigned char *text = NULL;
    int size = 0;
    if (at >= 0 && SSL_get_verify_result(tls->ssl) == X509_V_OK)
        size = ASN1_STRING_to_UTF8(&text, X509_NAME_ENTRY_get_data(X509_NAME_get_entry(name, at)));
    if (size > 0 && (size_t)size < sizeof t->peer->subject && !memchr(text, 0, (size_t)size)) {
        memcpy(t->peer->subject, text, (size_t)size);
        t->peer->subject[size] = 0;
    }
    OPENSSL_free(text);
    X509_free(certificate);
}

// ---- what was wrong -----------------------------------------------------------------------------

static HG_PRINTF(2, 3) void set_fault(struct tls *tls, const char *fmt, ...)
{
    va_list args;
    if (!tls->fault && !(tls->fault = hg_calloc(1, FAULT_BYTES)))
        return;
    va_start(args, fmt);
    vsnprintf(tls->fault, FAULT_BYTES, fmt, args);
    va_end(args);
}

static const char *name_version(int version)
{
    return version >= TLS1_2_VERSION   ? "TLS 1.2 without what is needed of it"
           : version == TLS1_1_VERSION ? "TLS 1.1"
           : version == TLS1_VERSION   ? "TLS 1.0"
                                       : "SSL";
}

// OpenSSL judges a certificate of the client's chain; what is wrong with it is known only here.
static int note_certificate(int is_good, X509_STORE_CTX *store)
{
    SSL *ssl = X509_STORE_CTX_get_ex_data(store, SSL_get_ex_data_X509_STORE_CTX_idx());
    X509 *certificate = X509_STORE_CTX_get0_cert(store);
    char name[129] = "";
    if (certificate)
        X509_NAME_get_text_by_NID(
            X509_get_subject_name(certificate), NID_commonName, name, sizeof name);
    if (!is_good)
        set_fault(SSL_get_app_data(ssl), "TLS: the client's certificate '%s' is refused: %s", name,
            X509_verify_cert_error_string(X509_STORE_CTX_get_error(store)));
    return is_good;
}

// Of the oldest error of OpenSSL.
static void explain(struct tls *tls)
{
    const unsigned long error = ERR_peek_error();
    const int reason = ERR_GET_LIB(error) == ERR_LIB_SSL ? ERR_GET_REASON(error) : 0;
    const char *text = ERR_reason_error_string(error);
    if (reason == SSL_R_CERTIFICATE_VERIFY_FAILED && tls->fault)
        return;
    if (reason == SSL_R_PEER_DID_NOT_RETURN_A_CERTIFICATE)
        set_fault(tls, "TLS: the client has no certificate (tls-client-auth=require)");
    else if (reason == SSL_R_HTTP_REQUEST)
        set_fault(tls, "TLS: a request of plain HTTP came; this listener speaks https and wss");
    else if (reason == SSL_R_WRONG_VERSION_NUMBER)
        set_fault(tls, "TLS: what came is not TLS, and this listener speaks nothing else");
    else if (reason == SSL_R_UNSUPPORTED_PROTOCOL)
        set_fault(tls, "TLS: the client speaks %s; 1.2 is the oldest version that is spoken here",
            name_version(SSL_client_version(tls->ssl)));
    else if (reason == SSL_R_NO_APPLICATION_PROTOCOL)
        set_fault(tls, "TLS: the client asks for neither hgp/1 nor http/1.1 (ALPN)");
    else if (reason > SSL_AD_REASON_OFFSET)
        set_fault(tls, "TLS: the client ended the handshake: %s",
            SSL_alert_desc_string_long(reason - SSL_AD_REASON_OFFSET));
    else
        set_fault(tls, "TLS: %s", text ? text : "the handshake failed");
}

static bool is_about_certificate(void)
{
    const unsigned long error = ERR_peek_error();
    return ERR_GET_LIB(error) == ERR_LIB_SSL &&
           (ERR_GET_REASON(error) == SSL_R_CERTIFICATE_VERIFY_FAILED ||
               ERR_GET_REASON(error) == SSL_R_PEER_DID_NOT_RETURN_A_CERTIFICATE);
}

// Before the handshake is done the peer has broken a rule and is told by an alert; behind it the
// stream is broken, and the session may go on over another one.
static enum hg_status fail(struct hg_transport *t, struct tls *tls)
{
    tls->failed = true;
    if (tls->open)
        return HG_E_IO;
    t->peer->unproven = is_about_certificate();
    hg_count(t->peer->unproven ? HG_COUNT_REFUSED_CERTIFICATE : HG_COUNT_REFUSED_TLS);
    explain(tls);
    t->fault = tls->fault ? tls->fault : "TLS: the handshake failed";
    return HG_E_FORMAT;
}

static enum hg_status judge(struct hg_transport *t, struct tls *tls, int result)
{
    switch (SSL_get_error(tls->ssl, result)) {
    case SSL_ERROR_WANT_READ:
    case SSL_ERROR_WANT_WRITE:
        return HG_E_AGAIN;
    case SSL_ERROR_ZERO_RETURN:
        return HG_E_CLOSED;
    case SSL_ERROR_SYSCALL:
        tls->failed = true;
        return HG_E_CLOSED;
    default:
        if (ERR_GET_REASON(ERR_peek_error()) == SSL_R_UNEXPECTED_EOF_WHILE_READING) {
            tls->failed = true;
            return HG_E_CLOSED;
        }
        return fail(t, tls);
    }
}

static enum hg_status shake_hands(struct hg_transport *t, struct tls *tls)
{
    int result = SSL_do_handshake(tls->ssl);
    if (result != 1)
        return judge(t, tls, result);
    tls->open = true;
    hg_count(HG_COUNT_TLS_HANDSHAKES);
    if (SSL_session_reused(tls->ssl))
        hg_count(HG_COUNT_TLS_RESUMED);
    take_subject(t, tls);
    t->peer->is_encrypted = true;
    return HG_OK;
}

static enum hg_status tls_read(struct hg_transport *t, void *dst, size_t size, size_t *got)
{
    struct tls *tls = t->state;
    *got = 0;
    if (tls->failed)
        return hg_transport_discard(&tls->below, tls->open ? HG_E_CLOSED : HG_E_FORMAT);
    ERR_clear_error();
    enum hg_status status = tls->open ? HG_OK : shake_hands(t, tls);
    if (status)
        return status;
    int result = SSL_read_ex(tls->ssl, dst, size, got);
    return result == 1 ? HG_OK : judge(t, tls, result);
}

static bool tls_has_input(const struct hg_transport *t)
{
    const struct tls *tls = t->state;
    return SSL_pending(tls->ssl) > 0;
}

// ---- writing ------------------------------------------------------------------------------------

// One record, of parts that are put together: each has its own cost.
static enum hg_status tls_write(
    struct hg_transport *t, const struct iovec *parts, int count, size_t *sent)
{
    static uint8_t record[RECORD_BYTES]; // of the loop's thread
    struct tls *tls = t->state;
    size_t size = 0;
    *sent = 0;
    enum hg_status status = flush_records(tls);
    if (status || tls->failed || !tls->open)
        return status ? status : tls->failed ? HG_E_CLOSED : HG_E_AGAIN;
    for (int i = 0; i < count && size < sizeof record; i++) {
        size_t step =
            parts[i].iov_len < sizeof record - size ? parts[i].iov_len : sizeof record - size;
        if (step) // an answer without a body has no bytes to copy from
            memcpy(record + size, parts[i].iov_base, step);
        size += step;
    }
    ERR_clear_error();
    int result = SSL_write_ex(tls->ssl, record, size, sent);
    return result == 1 ? HG_OK : judge(t, tls, result);
}

static enum hg_status tls_flush(struct hg_transport *t)
{
    return flush_records(t->state);
}

static uint32_t tls_wants(const struct hg_transport *t, bool read, bool write)
{
    const struct tls *tls = t->state;
    bool pending = tls->out_sent < tls->out_size;
    return (read || (!tls->open && !tls->failed) ? (uint32_t)EPOLLIN : 0u) |
           (pending || (write && (tls->open || tls->failed)) ? (uint32_t)EPOLLOUT : 0u);
}

static void tls_end_writing(struct hg_transport *t)
{
    struct tls *tls = t->state;
    ERR_clear_error();
    if (tls->open && !tls->failed)
        SSL_shutdown(tls->ssl);
    if (flush_records(tls) == HG_OK)
        tls->below.class->end_writing(&tls->below);
}

static void tls_close(struct hg_transport *t)
{
    struct tls *tls = t->state;
    ERR_clear_error();
    if (tls->open && !tls->failed && SSL_shutdown(tls->ssl) >= 0)
        (void)!flush_records(tls);
    SSL_free(tls->ssl);
    hg_transport_close(&tls->below);
    hg_free(tls->fault);
    hg_free(tls->out);
    hg_free(tls);
}

const struct hg_transport_class hg_transport_tls = {
    .read = tls_read,
    .write = tls_write,
    .wants = tls_wants,
    .end_writing = tls_end_writing,
    .close = tls_close,
    .flush = tls_flush,
    .has_input = tls_has_input,
};

enum hg_status hg_tls_begin(struct hg_transport *t, const struct hg_tls *context)
{
    struct tls *tls = hg_calloc(1, sizeof *tls);
    BIO *bio = tls && bio_method() ? BIO_new(bio_method()) : NULL;
    SSL *ssl = bio ? SSL_new(context->context) : NULL;
    if (!ssl) {
        BIO_free(bio);
        hg_free(tls);
        return HG_E_NOMEM;
    }
    tls->below = *t;
    tls->ssl = ssl;
    BIO_set_data(bio, tls);
    BIO_set_init(bio, 1);
    SSL_set_app_data(ssl, tls);
    SSL_set_bio(ssl, bio, bio);
    SSL_set_accept_state(ssl);
    hg_transport_become(t, &hg_transport_tls, tls);
    return HG_OK;
}

// ---- certificate and rules ----------------------------------------------------------------------

static enum hg_status refuse(const char *file, const char *what, struct hg_error *err)
{
    const unsigned long error = ERR_peek_error();
    const char *reason =
        ERR_SYSTEM_ERROR(error) ? strerror(ERR_GET_REASON(error)) : ERR_reason_error_string(error);
    return hg_error_set(
        err, HG_E_INVAL, file, NULL, "%s%s%s", what, reason ? ": " : "", reason ? reason : "");
}

// HGP, or HTTP/1.1 for browsers; a client that names neither is not ours.
static int choose_protocol(SSL *ssl, const unsigned char **out, unsigned char *out_size,
    const unsigned char *offered, unsigned size, void *user)
{
    static const unsigned char ours[] = "\x05hgp/1\x08http/1.1";
    (void)ssl;
    (void)user;
    return SSL_select_next_proto((unsigned char **)out, out_size, ours, sizeof ours - 1, offered,
               size) == OPENSSL_NPN_NEGOTIATED
               ? SSL_TLSEXT_ERR_OK
               : SSL_TLSEXT_ERR_ALERT_FATAL;
}

static void set_rules(SSL_CTX *context)
{
    static const unsigned char id[] = "heliod";
    SSL_CTX_set_min_proto_version(context, TLS1_2_VERSION);
    SSL_CTX_set_cipher_list(context, "ECDHE+AESGCM:ECDHE+CHACHA20:!aNULL");
    SSL_CTX_set_options(context, SSL_OP_NO_COMPRESSION | SSL_OP_NO_RENEGOTIATION |
                                     SSL_OP_CIPHER_SERVER_PREFERENCE | SSL_OP_PRIORITIZE_CHACHA);
    SSL_CTX_set_mode(context, SSL_MODE_RELEASE_BUFFERS | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER);
    SSL_CTX_set_session_cache_mode(context, SSL_SESS_CACHE_OFF); // clients have tickets
    SSL_CTX_set_num_tickets(context, 1);
    SSL_CTX_set_session_id_context(context, id, sizeof id - 1);
    SSL_CTX_set_alpn_select_cb(context, choose_protocol, NULL);
}

static enum hg_status load_files(SSL_CTX *context, const struct hg_options *o, struct hg_error *err)
{
    const char *key = o->tls_key ? o->tls_key : o->tls_cert;
    if (SSL_CTX_use_certificate_chain_file(context, o->tls_cert) != 1)
        return refuse(o->tls_cert, "no certificate can be read from it", err);
    if (SSL_CTX_use_PrivateKey_file(context, key, SSL_FILETYPE_PEM) != 1)
        return refuse(key,
            o->tls_key
                ? "no key for the certificate can be read from it"
                : "no key for the certificate can be read from it (tls-key names another file)",
            err);
    if (!o->tls_client_ca)
        return HG_OK;
    STACK_OF(X509_NAME) *names = SSL_load_client_CA_file(o->tls_client_ca);
    if (!names || SSL_CTX_load_verify_file(context, o->tls_client_ca) != 1) {
        sk_X509_NAME_pop_free(names, X509_NAME_free);
        return refuse(o->tls_client_ca, "no certificates can be read from it", err);
    }
    SSL_CTX_set_client_CA_list(context, names);
    const bool required = strcmp(o->tls_client_auth, "require") == 0;
    SSL_CTX_set_verify(context, SSL_VERIFY_PEER | (required ? SSL_VERIFY_FAIL_IF_NO_PEER_CERT : 0),
        note_certificate);
    return HG_OK;
}

// ---- validity -----------------------------------------------------------------------------------

static int64_t unix_time(const ASN1_TIME *time)
{
    struct tm tm;
    return ASN1_TIME_to_tm(time, &tm) ? (int64_t)timegm(&tm) : 0;
}

static void narrow(struct hg_tls *tls, const X509 *certificate)
{
    const int64_t begins_s = unix_time(X509_get0_notBefore(certificate));
    const int64_t ends_s = unix_time(X509_get0_notAfter(certificate));
    if (begins_s > tls->begins_s)
        tls->begins_s = begins_s;
    if (!tls->ends_s || ends_s < tls->ends_s)
        tls->ends_s = ends_s;
}

// From the latest begin to the earliest end of the certificate and those that it was signed by.
static void note_validity(struct hg_tls *tls, SSL_CTX *context)
{
    STACK_OF(X509) *chain = NULL;
    narrow(tls, SSL_CTX_get0_certificate(context));
    SSL_CTX_get0_chain_certs(context, &chain);
    for (int i = 0; i < sk_X509_num(chain); i++) // -1 without a chain
        narrow(tls, sk_X509_value(chain, i));
}

void hg_tls_warn(const struct hg_tls *tls, const char *file)
{
    const int64_t now_s = time(NULL);
    const time_t of_s = tls->begins_s > now_s ? tls->begins_s : tls->ends_s;
    char date[32];
    struct tm tm;
    if (!tls->context)
        return;
    gmtime_r(&of_s, &tm);
    strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%SZ", &tm);
    if (tls->begins_s > now_s)
        hg_warn(NET, "the certificate in %s is valid from %s on: clients refuse it", file, date);
    else if (tls->ends_s <= now_s)
        hg_warn(NET, "the certificate in %s has expired at %s: clients refuse it", file, date);
    else if (tls->ends_s - now_s < SOON_S)
        hg_warn(NET, "the certificate in %s expires at %s", file, date);
}

// ---- opening ------------------------------------------------------------------------------------

// Of the authorities' file, as it was just read, and of whether a certificate is required.
static enum hg_status hash_clients(
    const struct hg_options *o, uint8_t digest[HG_SHA256_BYTES], struct hg_error *err)
{
    uint8_t *data = NULL;
    size_t size = 0;
    memset(digest, 0, HG_SHA256_BYTES);
    if (!o->tls_client_ca)
        return HG_OK;
    enum hg_status status = hg_file_read(o->tls_client_ca, CLIENT_CA_BYTES, &data, &size, err);
    struct hg_sha256 *hasher = status ? NULL : hg_sha256_create();
    if (hasher) {
        hg_sha256_update(hasher, o->tls_client_auth, strlen(o->tls_client_auth) + 1);
        hg_sha256_update(hasher, data, size);
        hg_sha256_end(hasher, digest);
    } else if (!status) {
        status = hg_error_set(err, HG_E_NOMEM, "--tls-client-ca", NULL, "no memory");
    }
    hg_free(data);
    return status;
}

enum hg_status hg_tls_open(const struct hg_options *o, struct hg_tls *out, struct hg_error *err)
{
    *out = (struct hg_tls){0};
    ERR_clear_error();
    if (!o->tls_client_ca && strcmp(o->tls_client_auth, "require") == 0)
        return hg_error_set(err, HG_E_INVAL, "--tls-client-auth", NULL,
            "require needs --tls-client-ca: without it no certificate is asked for");
    if (!o->tls_cert)
        return o->tls_client_ca || o->tls_key
                   ? hg_error_set(err, HG_E_INVAL, "--tls-cert", NULL, "name the certificate, too")
                   : HG_OK;
    SSL_CTX *context = SSL_CTX_new(TLS_server_method());
    if (!context)
        return hg_error_set(err, HG_E_NOMEM, "--tls-cert", NULL, "no memory");
    set_rules(context);
    enum hg_status status = load_files(context, o, err);
    if (!status)
        status = hash_clients(o, out->clients, err);
    if (status) {
        SSL_CTX_free(context);
        return status;
    }
    note_validity(out, context);
    out->context = context;
    return HG_OK;
}

void hg_tls_replace(struct hg_tls *into, struct hg_tls *from)
{
    unsigned char keys[TICKET_KEY_BYTES];
    if (into->context && from->context &&
        memcmp(into->clients, from->clients, sizeof into->clients) == 0 &&
        SSL_CTX_get_tlsext_ticket_keys(into->context, keys, sizeof keys) == 1)
        SSL_CTX_set_tlsext_ticket_keys(from->context, keys, sizeof keys);
    OPENSSL_cleanse(keys, sizeof keys);
    hg_tls_finish(into);
    *into = *from;
    *from = (struct hg_tls){0};
}

void hg_tls_finish(struct hg_tls *tls)
{
    SSL_CTX_free(tls->context);
    *tls = (struct hg_tls){0};
}
