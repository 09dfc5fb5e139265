// guessing.c - join tickets are guessed, while another tenant works: nothing but the ticket itself
// lets in, all wrong ones look alike, are counted, and cost the daemon nothing.
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/clock.h"
#include "base/sha256.h"
#include "tests/attack/tenant_rig.h"
#include "tests/fuzz/mutate.h"

enum { GUESSES = 1000, SHOWN = 100, MIB = 1 << 20 };

struct rig {
    struct daemon d;
    struct peer issuer, honest; // of anna, of bert
    struct hgp_join_ticket ticket;
    char secret[129];
};

static void make_ticket(struct rig *r, const char *scene, uint32_t uses)
{
    peer_call(&r->issuer, HGP_T_join_make,
        &(struct hgp_join_make){.has_scene = true,
            .scene = hgp_str_make(scene),
            .has_uses = true,
            .uses = uses,
            .has_role = true,
            .role = HGP_role_EDIT},
        HGP_T_join_ticket);
    r->ticket = r->issuer.m.join_ticket;
    snprintf(
        r->secret, sizeof r->secret, "%.*s", (int)r->ticket.secret.size, r->ticket.secret.data);
}

static void begin(struct rig *r, const char *failures)
{
    char path[TEST_FOLDER_MAX + 8];
    tenant_rig_init(&r->d);
    snprintf(path, sizeof path, "%s/audit", r->d.folder);
    daemon_option(&r->d, "audit", path);
    daemon_option(&r->d, "auth-failures", failures);
    daemon_option(&r->d, "auth-failures-total", "1000000");
    daemon_start(&r->d);
    tenant_enter(&r->honest, &r->d, "bert-token-1", "hall");
    peer_view(&r->honest, 1, 16, 16);
    tenant_enter(&r->issuer, &r->d, "anna-token-1", "hall");
    make_ticket(r, "hall", 1);
}

static void end(struct rig *r)
{
    peer_close(&r->issuer);
    peer_close(&r->honest);
    daemon_finish(&r->d);
}

static void honest_one_is_served(struct rig *r)
{
    struct peer *p = &r->honest;
    peer_call(p, HGP_T_node_set, &(struct hgp_node_set){.node = p->first_id}, HGP_T_ok);
    peer_call(p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
}

static void ask(struct peer *p, struct rig *r, const char *secret)
{
    peer_connect(p, &r->d, true);
    peer_hello(p);
    peer_auth(p, secret);
}

// The answer is the same, whatever was wrong with it.
static void is_wrong(struct peer *p)
{
    assert_true(peer_next(p));
    assert_int_equal(p->header.type, HGP_T_error);
    assert_int_equal(p->m.error.code, HG_E_AUTH);
    assert_true(peer_says(p, "the token is not known, or has expired"));
    peer_end(p);
    peer_close(p);
}

static void guess(struct rig *r, const char *secret)
{
    struct peer p;
    ask(&p, r, secret);
    is_wrong(&p);
}

static void lets_in(struct rig *r, const char *secret)
{
    struct peer p;
    ask(&p, r, secret);
    assert_true(peer_next(&p));
    assert_int_equal(p.header.type, HGP_T_join_scene);
    assert_true(peer_next(&p));
    assert_int_equal(p.header.type, HGP_T_auth_ok);
    peer_scene(&p, "hall");
    peer_close(&p);
}

static int count_audited(struct rig *r)
{
    char *log = daemon_read(&r->d, "audit"), *rest = log;
    int count = 0;
    for (char *line; (line = strsep(&rest, "\n"));)
        count += strstr(line, "\"login\"") && strstr(line, "\"result\":\"auth\"");
    free(log);
    return count;
}

// One that is nearly right: a character is another one, is missing, is there twice.
static void spoil(char *out, size_t size, const char *secret, size_t n)
{
    const size_t length = strlen(secret), at = n % length;
    snprintf(out, size, "%s", secret);
    if (n < length)
        out[at] = out[at] == 'A' ? 'B' : 'A';
    else if (n < 2 * length)
        memmove(out + at, out + at + 1, length - at);
    else
        memmove(out + at + 1, out + at, length - at + 1);
}

static void nearly_right_is_wrong(void **state)
{
    (void)state;
    struct rig r;
    char text[200], hex[HG_SHA256_HEX];
    uint8_t digest[32];
    begin(&r, "100000");
    const size_t length = strlen(r.secret);
    int guesses = 0;
    for (size_t n = 0; n < 3 * length; n++, guesses++) {
        spoil(text, sizeof text, r.secret, n);
        assert_string_not_equal(text, r.secret);
        guess(&r, text);
    }
    // What the daemon keeps of it, its number, its scene: none of that is the ticket.
    assert_int_equal(hg_sha256(r.secret, length, digest), HG_OK);
    hg_sha256_hex(digest, hex);
    guess(&r, hex);
    snprintf(text, sizeof text, "sha256:%s", hex);
    guess(&r, text);
    snprintf(text, sizeof text, "hj-%llu", (unsigned long long)r.ticket.ticket);
    guess(&r, text);
    guess(&r, "hj-");
    guess(&r, "hall");
    honest_one_is_served(&r);
    lets_in(&r, r.secret); // it is still good, once
    guess(&r, r.secret);   // a used one is as one that never was
    make_ticket(&r, "hall", 100);
    lets_in(&r, r.secret);
    peer_call(&r.issuer, HGP_T_join_revoke, &(struct hgp_join_revoke){.ticket = r.ticket.ticket},
        HGP_T_ok);
    guess(&r, r.secret); // and a revoked one as well
    assert_int_equal(count_audited(&r), guesses + 7);
    honest_one_is_served(&r);
    end(&r);
}

// A ticket of one tenant opens that tenant's scene, and not the other one's of the same name.
static void tickets_stay_with_their_tenant(void **state)
{
    (void)state;
    struct rig r;
    struct peer p;
    begin(&r, "10");
    peer_call(
        &r.honest, HGP_T_node_set, &(struct hgp_node_set){.node = r.honest.first_id}, HGP_T_ok);
    ask(&p, &r, r.secret);
    assert_true(peer_next(&p) && peer_next(&p));
    assert_int_equal(p.header.type, HGP_T_auth_ok);
    peer_call(&p, HGP_T_scene_open, &(struct hgp_scene_open){.name = hgp_str_make("hall")},
        HGP_T_scene_opened);
    assert_int_equal(p.m.scene_opened.revision, 0); // of anna, who has edited nothing
    peer_refused(&p, HGP_T_join_make, &(struct hgp_join_make){0}, HG_E_PERM);
    peer_refused(
        &p, HGP_T_join_revoke, &(struct hgp_join_revoke){.ticket = r.ticket.ticket}, HG_E_NOTFOUND);
    // Nor can the other tenant revoke it, or learn that it is there.
    peer_refused(&r.honest, HGP_T_join_revoke, &(struct hgp_join_revoke){.ticket = r.ticket.ticket},
        HG_E_NOTFOUND);
    peer_call(&r.honest, HGP_T_join_query, &(struct hgp_join_query){0}, HGP_T_json);
    assert_null(memmem(r.honest.m.json.text.data, r.honest.m.json.text.size, "\"scene\"", 7));
    peer_close(&p);
    end(&r);
}

static void make_guess(struct fuzz_random *random, char *out)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
    memcpy(out, "hj-", 3);
    for (int i = 3; i < 46; i++)
        out[i] = digits[fuzz_below(random, 64)];
    out[46] = 0;
}

static void guesses_in_volume_cost_nothing(void **state)
{
    (void)state;
    struct rig r;
    struct fuzz_random random = fuzz_random_start();
    char text[47];
    begin(&r, "100000"); // so that there are many
    for (int i = 0; i < SHOWN; i++) {
        make_guess(&random, text);
        guess(&r, text);
    }
    const uint64_t before = daemon_rss_bytes(&r.d);
    for (int i = 0; i < GUESSES; i++) {
        make_guess(&random, text);
        guess(&r, text);
        if (i % 100 == 0)
            honest_one_is_served(&r);
    }
    const uint64_t after = daemon_rss_bytes(&r.d);
    print_message(
        "%d guesses, memory +%.1f MiB\n", GUESSES, ((double)after - (double)before) / MIB);
    assert_true(after < before + daemon_allowed(2 * MIB));
    assert_int_equal(count_audited(&r), SHOWN + GUESSES);
    lets_in(&r, r.secret);
    end(&r);
}

// However many connections guess at a time: with the usual limits they wait, and the honest ones
// do not.
static void guesses_at_a_time_wait(void **state)
{
    (void)state;
    enum { AT_A_TIME = 30, FREE = 3 };
    const uint64_t second_ns = 1000000000;
    struct rig r;
    struct peer p[AT_A_TIME];
    struct fuzz_random random = fuzz_random_start();
    char text[47];
    begin(&r, "3");
    const uint64_t begun_ns = hg_clock_now_ns();
    for (int i = 0; i < AT_A_TIME; i++) {
        peer_connect(&p[i], &r.d, true);
        peer_hello(&p[i]);
    }
    for (int i = 0; i < AT_A_TIME; i++) {
        make_guess(&random, text);
        peer_auth(&p[i], text);
        if (i < FREE) // these are judged at once, each before the next one comes
            is_wrong(&p[i]);
    }
    honest_one_is_served(&r);
    for (int i = FREE; i < AT_A_TIME; i++)
        is_wrong(&p[i]);
    assert_true(hg_clock_now_ns() - begun_ns >= second_ns);
    assert_int_equal(count_audited(&r), AT_A_TIME);
    lets_in(&r, r.secret); // after a wait, from the same address
    end(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nearly_right_is_wrong),
        cmocka_unit_test(tickets_stay_with_their_tenant),
        cmocka_unit_test(guesses_in_volume_cost_nothing),
        cmocka_unit_test(guesses_at_a_time_wait),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
