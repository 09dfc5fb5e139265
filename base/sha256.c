#include "base/sha256.h"

#include <openssl/evp.h>
#include <string.h>

// The opaque hasher is OpenSSL's digest context under our name.
static EVP_MD_CTX *context(struct hg_sha256 *h)
{
    return (EVP_MD_CTX *)h;
}

struct hg_sha256 *hg_sha256_create(void)
{
    EVP_MD_CTX *ctx = EVP_MD_CTX_new();
    if (ctx && !EVP_DigestInit_ex(ctx, EVP_sha256(), NULL)) {
        EVP_MD_CTX_free(ctx);
        ctx = NULL;
    }
    return (struct hg_sha256 *)ctx;
}

void hg_sha256_update(struct hg_sha256 *h, const void *data, size_t size)
{
    EVP_DigestUpdate(context(h), data, size);
}

void hg_sha256_end(struct hg_sha256 *h, uint8_t digest[HG_SHA256_BYTES])
{
    EVP_DigestFinal_ex(context(h), digest, NULL);
    EVP_MD_CTX_free(context(h));
}

enum hg_status hg_sha256(const void *data, size_t size, uint8_t digest[HG_SHA256_BYTES])
{
    memset(digest, 0, HG_SHA256_BYTES);
    return EVP_Digest(data, size, digest, NULL, EVP_sha256(), NULL) ? HG_OK : HG_E_NOMEM;
}

void hg_sha256_hex(const uint8_t digest[HG_SHA256_BYTES], char hex[HG_SHA256_HEX])
{
    static const char digits[] = "0123456789abcdef";
    for (int i = 0; i < HG_SHA256_BYTES; i++) {
        hex[2 * i] = digits[digest[i] >> 4];
        hex[2 * i + 1] = digits[digest[i] & 15];
    }
    hex[64] = 0;
}

static int hex_digit(char c)
{
    return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

bool hg_sha256_parse(const char *text, size_t bytes, uint8_t digest[HG_SHA256_BYTES])
{
    memset(digest, 0, HG_SHA256_BYTES);
    for (size_t i = 0; i < bytes; i++) {
        int high = hex_digit(text[2 * i]), low = high < 0 ? -1 : hex_digit(text[2 * i + 1]);
        if (low < 0)
            return false;
        digest[i] = (uint8_t)(high << 4 | low);
    }
    return !text[2 * bytes];
}
