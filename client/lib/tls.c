#include "client/lib/tls.h"

#include <arpa/inet.h>
#include <errno.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/sha256.h"

struct tls {
    struct hg_client_transport below;
    SSL_CTX *context;
    SSL *ssl;
    BIO_METHOD *method;
    uint8_t pin[32];
    char refusal[120];
    bool has_pin, wants_write, broken;
};

// ---- the socket, for OpenSSL, whose own would raise SIGPIPE -------------------------------------

static int bio_result(BIO *bio, enum hg_status status, size_t done, int retry)
{
    BIO_clear_retry_flags(bio);
    if (!status)
        return (int)done;
    if (status == HG_E_AGAIN)
        BIO_set_flags(bio, retry | BIO_FLAGS_SHOULD_RETRY);
    return status == HG_E_CLOSED ? 0 : -1;
}

static int bio_read(BIO *bio, char *data, int size)
{
    struct tls *tls = BIO_get_data(bio);
    size_t got = 0;
    if (size <= 0)
        return 0;
    enum hg_status status = tls->below.class->read(&tls->below, data, (size_t)size, &got);
    return bio_result(bio, status, got, BIO_FLAGS_READ);
}

static int bio_write(BIO *bio, const char *data, int size)
{
    struct tls *tls = BIO_get_data(bio);
    size_t sent = 0;
    if (size <= 0)
        return 0;
    enum hg_status status = tls->below.class->write(&tls->below, data, (size_t)size, &sent);
    return bio_result(bio, status == HG_E_CLOSED ? HG_E_IO : status, sent, BIO_FLAGS_WRITE);
}

static long bio_control(BIO *bio, int command, long number, void *pointer)
{
    (void)bio;
    (void)number;
    (void)pointer;
    return command == BIO_CTRL_FLUSH;
}

static BIO *create_bio(struct tls *tls)
{
    tls->method = BIO_meth_new(BIO_TYPE_SOURCE_SINK, "helio");
    if (!tls->method)
        return NULL;
    BIO_meth_set_read(tls->method, bio_read);
    BIO_meth_set_write(tls->method, bio_write);
    BIO_meth_set_ctrl(tls->method, bio_control);
    BIO *bio = BIO_new(tls->method);
    if (bio) {
        BIO_set_data(bio, tls);
        BIO_set_init(bio, 1);
    }
    return bio;
}

static void destroy(struct tls *tls)
{
    SSL_free(tls->ssl);
    SSL_CTX_free(tls->context);
    BIO_meth_free(tls->method);
    hg_free(tls);
}

// ---- the stream ---------------------------------------------------------------------------------

static const char *newest_reason(void)
{
    const unsigned long error = ERR_peek_error();
    if (ERR_SYSTEM_ERROR(error))
        return strerror(ERR_GET_REASON(error));
    const char *reason = ERR_reason_error_string(error);
    return reason ? reason : "the handshake failed";
}

static const char *handshake_fault(const struct tls *tls)
{
    if (ERR_peek_error())
        return newest_reason();
    return tls->below.error_number ? strerror(tls->below.error_number)
                                   : "the server ended the handshake; it may not speak TLS there";
}

// The alert of the server, if it is about the client's certificate. With TLS 1.3 it comes when the
// client's handshake is done.
static bool is_refused(struct hg_client_transport *t, struct tls *tls)
{
    const unsigned long error = ERR_peek_error();
    const int alert = ERR_GET_REASON(error) - SSL_AD_REASON_OFFSET;
    if (ERR_GET_LIB(error) != ERR_LIB_SSL)
        return false;
    if (alert == SSL_AD_CERTIFICATE_REQUIRED)
        snprintf(tls->refusal, sizeof tls->refusal, "asks for a certificate (--tls-cert)");
    else if ((alert >= SSL_AD_BAD_CERTIFICATE && alert <= SSL_AD_CERTIFICATE_UNKNOWN) ||
             alert == SSL_AD_UNKNOWN_CA || alert == SSL_AD_ACCESS_DENIED)
        snprintf(tls->refusal, sizeof tls->refusal, "refuses this client's certificate: %s",
            SSL_alert_desc_string_long(alert));
    else
        return false;
    t->refusal = tls->refusal;
    return true;
}

static enum hg_status judge(struct hg_client_transport *t, struct tls *tls, int result)
{
    const int error = SSL_get_error(tls->ssl, result);
    tls->wants_write = error == SSL_ERROR_WANT_WRITE;
    if (error == SSL_ERROR_WANT_READ || error == SSL_ERROR_WANT_WRITE)
        return HG_E_AGAIN;
    if (error == SSL_ERROR_ZERO_RETURN ||
        ERR_GET_REASON(ERR_peek_error()) == SSL_R_UNEXPECTED_EOF_WHILE_READING)
        return HG_E_CLOSED;
    tls->broken = true;
    if (is_refused(t, tls))
        return HG_E_AUTH;
    t->error_number = error == SSL_ERROR_SYSCALL && errno ? errno : EPROTO;
    return HG_E_IO;
}

static enum hg_status tls_read(struct hg_client_transport *t, void *dst, size_t size, size_t *got)
{
    struct tls *tls = t->state;
    *got = 0;
    ERR_clear_error();
    int result = SSL_read_ex(tls->ssl, dst, size, got);
    return result == 1 ? HG_OK : judge(t, tls, result);
}

static enum hg_status tls_write(
    struct hg_client_transport *t, const void *data, size_t size, size_t *sent)
{
    struct tls *tls = t->state;
    *sent = 0;
    ERR_clear_error();
    int result = SSL_write_ex(tls->ssl, data, size, sent);
    return result == 1 ? HG_OK : judge(t, tls, result);
}

static short tls_wants(const struct hg_client_transport *t, bool read, bool write)
{
    const struct tls *tls = t->state;
    return (short)((read || write ? POLLIN : 0) | (write || tls->wants_write ? POLLOUT : 0));
}

static bool tls_has_input(const struct hg_client_transport *t)
{
    const struct tls *tls = t->state;
    return SSL_pending(tls->ssl) > 0;
}

static enum hg_status check_pin(struct tls *tls, const char *url, struct hg_error *err)
{
    uint8_t hash[32];
    unsigned size = sizeof hash;
    X509 *certificate = SSL_get1_peer_certificate(tls->ssl);
    const bool same = certificate && X509_digest(certificate, EVP_sha256(), hash, &size) &&
                      memcmp(hash, tls->pin, sizeof hash) == 0;
    X509_free(certificate);
    return same ? HG_OK
                : hg_error_set(err, HG_E_AUTH, url, NULL,
                      "the server's certificate is not the pinned one (--tls-pin)");
}

static enum hg_status tls_handshake(
    struct hg_client_transport *t, const char *url, struct hg_error *err)
{
    struct tls *tls = t->state;
    ERR_clear_error();
    int result = SSL_do_handshake(tls->ssl);
    if (result == 1)
        return tls->has_pin ? check_pin(tls, url, err) : HG_OK;
    enum hg_status status = judge(t, tls, result);
    if (status == HG_E_AGAIN)
        return status;
    const long verified = SSL_get_verify_result(tls->ssl);
    if (verified != X509_V_OK)
        return hg_error_set(err, HG_E_AUTH, url, NULL, "the server's certificate: %s",
            X509_verify_cert_error_string(verified));
    if (status == HG_E_AUTH)
        return hg_error_set(err, status, url, NULL, "the server %s", t->refusal);
    return hg_error_set(err, HG_E_CLOSED, url, NULL, "TLS: %s", handshake_fault(tls));
}

static void tls_close(struct hg_client_transport *t)
{
    struct tls *tls = t->state;
    ERR_clear_error();
    if (SSL_is_init_finished(tls->ssl) && !tls->broken)
        SSL_shutdown(tls->ssl);
    tls->below.class->close(&tls->below);
    destroy(tls);
}

static const struct hg_client_transport_class tls_class = {
    .read = tls_read,
    .write = tls_write,
    .wants = tls_wants,
    .close = tls_close,
    .handshake = tls_handshake,
    .has_input = tls_has_input,
};

// ---- trust --------------------------------------------------------------------------------------

static enum hg_status set_trust(struct tls *tls, const struct hg_client_tls_options *o,
    const char *host, const char *url, struct hg_error *err)
{
    struct in6_addr any;
    const bool numeric =
        inet_pton(AF_INET, host, &any) == 1 || inet_pton(AF_INET6, host, &any) == 1;
    if (!numeric)
        SSL_set_tlsext_host_name(tls->ssl, host);
    tls->has_pin = o->pin != NULL;
    if (tls->has_pin && !hg_sha256_parse(o->pin, sizeof tls->pin, tls->pin))
        return hg_error_set(err, HG_E_INVAL, url, NULL,
            "the pin (--tls-pin): expected the SHA-256 of a certificate, 64 digits 0-9 a-f");
    if (tls->has_pin || o->insecure)
        return HG_OK;
    if (o->ca ? SSL_CTX_load_verify_file(tls->context, o->ca) != 1
              : SSL_CTX_set_default_verify_paths(tls->context) != 1)
        return hg_error_set(err, HG_E_INVAL, url, NULL,
            "no certificates of authorities can be read from %s: %s",
            o->ca ? o->ca : "the system's folder", newest_reason());
    SSL_set_verify(tls->ssl, SSL_VERIFY_PEER, NULL);
    X509_VERIFY_PARAM *rules = SSL_get0_param(tls->ssl);
    if (numeric ? X509_VERIFY_PARAM_set1_ip_asc(rules, host) != 1
                : SSL_set1_host(tls->ssl, host) != 1)
        return hg_error_set(err, HG_E_INVAL, url, NULL, "the host's name is not a name");
    return HG_OK;
}

static enum hg_status set_certificate(
    struct tls *tls, const struct hg_client_tls_options *o, const char *url, struct hg_error *err)
{
    const char *key = o->key ? o->key : o->cert;
    if (!o->cert)
        return HG_OK;
    if (SSL_use_certificate_chain_file(tls->ssl, o->cert) != 1 ||
        SSL_use_PrivateKey_file(tls->ssl, key, SSL_FILETYPE_PEM) != 1)
        return hg_error_set(err, HG_E_INVAL, url, NULL,
            "no certificate and key can be read from %s%s%s: %s", o->cert, o->key ? " and " : "",
            o->key ? o->key : "", newest_reason());
    return HG_OK;
}

static struct tls *create(const struct hg_client_transport *t)
{
    struct tls *tls = hg_calloc(1, sizeof *tls);
    if (!tls)
        return NULL;
    tls->below = *t;
    tls->context = SSL_CTX_new(TLS_client_method());
    tls->ssl = tls->context ? SSL_new(tls->context) : NULL;
    BIO *bio = tls->ssl ? create_bio(tls) : NULL;
    if (!bio) {
        destroy(tls);
        return NULL;
    }
    SSL_set_bio(tls->ssl, bio, bio);
    return tls;
}

enum hg_status hg_client_tls_begin(struct hg_client_transport *t,
    const struct hg_client_tls_options *o, const char *host, const char *url, struct hg_error *err)
{
    static const unsigned char hgp[] = "\x05hgp/1", http[] = "\x08http/1.1";
    ERR_clear_error();
    struct tls *tls = create(t);
    if (!tls)
        return hg_error_set(err, HG_E_NOMEM, url, NULL, "no memory for TLS");
    SSL_set_min_proto_version(tls->ssl, TLS1_2_VERSION);
    SSL_set_mode(tls->ssl, SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER);
    SSL_set_connect_state(tls->ssl);
    SSL_set_alpn_protos(
        tls->ssl, t->websocket ? http : hgp, (t->websocket ? sizeof http : sizeof hgp) - 1);
    enum hg_status status = set_trust(tls, o, host, url, err);
    if (!status)
        status = set_certificate(tls, o, url, err);
    if (status) {
        destroy(tls);
        return status;
    }
    t->class = &tls_class;
    t->state = tls;
    t->handshaking = true;
    return HG_OK;
}
