// test_people.c - several sessions in one scene: who is there, the shared camera, the order of
// edits, annotations.
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "tests/system/daemon.h"

// Reads until a message of this type comes; others are of no interest.
static void await(struct peer *p, enum hgp_type type)
{
    do {
        if (!peer_next(p))
            fail_msg("the daemon closed the connection");
        if (p->header.type == HGP_T_notice && p->m.notice.code != HG_E_WORKER)
            fail_msg("notice: %.*s", (int)p->m.notice.reason.size, p->m.notice.reason.data);
    } while (p->header.type != type);
}

static void watch(struct peer *p, struct hgp_scene_watch m)
{
    peer_call(p, HGP_T_scene_watch, &m, HGP_T_ok);
}

static void join(struct peer *p, struct daemon *d, const char *token)
{
    peer_enter(p, d, token);
    peer_scene(p, "hall");
}

static const char *const tokens[] = {"view-token-1", "edit-token-1", "admin-token-1"};
enum { VIEWER, EDITOR, ADMIN, PEOPLE };

struct hall {
    struct daemon d;
    struct peer p[PEOPLE];
};

static void open_hall(struct hall *h)
{
    daemon_start(&h->d);
    for (int i = 0; i < PEOPLE; i++)
        join(&h->p[i], &h->d, tokens[i]);
}

static void close_hall(struct hall *h)
{
    for (int i = 0; i < PEOPLE; i++)
        peer_close(&h->p[i]);
    daemon_finish(&h->d);
}

// ---- who is there -------------------------------------------------------------------------------

static const struct hgp_participant *find_participant(struct peer *p, uint64_t session)
{
    for (uint32_t i = 0; i < p->m.participants.sessions.count; i++)
        if (p->m.participants.sessions.items[i].session == session)
            return &p->m.participants.sessions.items[i];
    return NULL;
}

static void await_count(struct peer *p, uint32_t count)
{
    do
        await(p, HGP_T_participants);
    while (p->m.participants.sessions.count != count);
}

static void tells_who_is_there(void **state)
{
    (void)state;
    struct hall h;
    daemon_init_tokens(&h.d);
    open_hall(&h);
    watch(&h.p[ADMIN],
        (struct hgp_scene_watch){
            .has_participants = true, .participants = true, .has_cursors = true, .cursors = true});
    peer_call(&h.p[VIEWER], HGP_T_participant_set,
        &(struct hgp_participant_set){.has_label = true,
            .label = hgp_str_make("Anna B."),
            .has_color = true,
            .color = 0x102030},
        HGP_T_ok);
    const struct hgp_participant *anna;
    do {
        await_count(&h.p[ADMIN], PEOPLE);
        anna = find_participant(&h.p[ADMIN], h.p[VIEWER].session);
        assert_non_null(anna);
    } while (!anna->label.size);
    assert_int_equal(anna->role, HGP_role_VIEW);
    assert_memory_equal(anna->name.data, "anna", anna->name.size); // what the token says stays
    assert_memory_equal(anna->label.data, "Anna B.", anna->label.size);
    assert_int_equal(anna->color, 0x102030);
    assert_false(anna->away);
    // A cursor, the newest of many.
    for (uint32_t i = 1; i <= 500; i++)
        peer_tell(&h.p[VIEWER], HGP_T_cursor_set,
            &(struct hgp_cursor_set){.shown = true, .node = i, .position = {1, 2, 3}});
    uint32_t told = 0;
    do {
        await(&h.p[ADMIN], HGP_T_cursor);
        told++;
    } while (h.p[ADMIN].m.cursor.node != 500);
    assert_true(told < 250); // coalesced
    assert_int_equal(h.p[ADMIN].m.cursor.session, h.p[VIEWER].session);
    // Kept without a connection it is away; gone it is gone.
    peer_call(&h.p[EDITOR], HGP_T_keep, &(struct hgp_keep){0}, HGP_T_ticket);
    peer_close(&h.p[EDITOR]);
    const struct hgp_participant *bert;
    do {
        await_count(&h.p[ADMIN], PEOPLE);
        bert = find_participant(&h.p[ADMIN], h.p[EDITOR].session);
    } while (!bert->away);
    peer_close(&h.p[VIEWER]);
    await_count(&h.p[ADMIN], 2);
    peer_close(&h.p[ADMIN]);
    daemon_finish(&h.d);
}

static void nothing_is_told_unasked(void **state)
{
    (void)state;
    struct hall h;
    daemon_init_tokens(&h.d);
    open_hall(&h);
    peer_call(&h.p[EDITOR], HGP_T_node_set, &(struct hgp_node_set){.node = h.p[EDITOR].first_id},
        HGP_T_ok);
    peer_call(&h.p[EDITOR], HGP_T_camera_request, &(struct hgp_camera_request){0}, HGP_T_ok);
    assert_false(peer_next_within(&h.p[VIEWER], 200));
    peer_refused(&h.p[VIEWER], HGP_T_camera_take, &(struct hgp_camera_take){0}, HG_E_PERM);
    peer_refused(&h.p[EDITOR], HGP_T_camera_lock, &(struct hgp_camera_lock){0}, HG_E_PERM);
    close_hall(&h);
}

// ---- the shared camera --------------------------------------------------------------------------

static void await_holder(struct peer *p, uint64_t holder, enum hgp_camera_change change)
{
    do
        await(p, HGP_T_camera_state);
    while (p->m.camera_state.holder != holder);
    assert_int_equal(p->m.camera_state.change, change);
}

static void move(struct peer *p, uint64_t seq)
{
    peer_tell(p, HGP_T_view_camera,
        &(struct hgp_view_camera){.view = 1,
            .input_seq = seq,
            .has_eye = true,
            .eye = {(float)seq, 0, 5},
            .has_target = true});
}

static void follow(struct peer *p)
{
    peer_view(p, 1, 16, 16);
    peer_call(
        p, HGP_T_camera_follow, &(struct hgp_camera_follow){.view = 1, .follow = true}, HGP_T_ok);
}

// The picture that a view shows when it has come to the camera of this number.
static void frame_at(struct peer *p, uint64_t seq, uint8_t digest[32])
{
    for (int i = 0; i < 200; i++) {
        peer_call(p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
        if (p->m.frame.input_seq == seq) {
            memcpy(digest, p->m.frame.data.data, 32);
            return;
        }
        usleep(20000);
    }
    fail_msg("the view never came to camera %llu", (unsigned long long)seq);
}

static void followers_see_what_the_holder_sees(void **state)
{
    (void)state;
    struct hall h;
    uint8_t leader[32], follower[32];
    daemon_init_tokens(&h.d);
    open_hall(&h);
    for (int i = 0; i < PEOPLE; i++)
        follow(&h.p[i]);
    watch(&h.p[EDITOR], (struct hgp_scene_watch){.has_camera = true, .camera = true});
    peer_call(&h.p[VIEWER], HGP_T_camera_request, &(struct hgp_camera_request){0}, HGP_T_ok);
    await_holder(&h.p[EDITOR], h.p[VIEWER].session, HGP_camera_change_REQUESTED);
    for (uint64_t seq = 1; seq <= 300; seq++)
        move(&h.p[VIEWER], seq);
    do
        await(&h.p[EDITOR], HGP_T_camera_moved);
    while (h.p[EDITOR].m.camera_moved.input_seq != 300);
    assert_int_equal(h.p[EDITOR].m.camera_moved.session, h.p[VIEWER].session);
    assert_true(h.p[EDITOR].m.camera_moved.has_eye && h.p[EDITOR].m.camera_moved.eye[0] == 300);
    frame_at(&h.p[ADMIN], 300, follower);
    // A camera of one that does not have it changes nothing; with a request number it is an error.
    move(&h.p[EDITOR], 1000);
    peer_refused(&h.p[EDITOR], HGP_T_view_camera,
        &(struct hgp_view_camera){.view = 1, .input_seq = 1001}, HG_E_PERM);
    frame_at(&h.p[EDITOR], 300, leader);
    // The worker dies: followers have the same camera in the new one.
    kill(daemon_worker(&h.d, 0), SIGKILL);
    frame_at(&h.p[ADMIN], 300, follower);
    move(&h.p[VIEWER], 301);
    frame_at(&h.p[EDITOR], 301, leader);
    // Taken, the other one moves it.
    peer_call(&h.p[EDITOR], HGP_T_camera_take, &(struct hgp_camera_take){0}, HGP_T_ok);
    move(&h.p[VIEWER], 2000);
    move(&h.p[EDITOR], 302);
    frame_at(&h.p[VIEWER], 302, leader);
    frame_at(&h.p[ADMIN], 302, follower);
    close_hall(&h);
}

static void camera_is_given_and_locked(void **state)
{
    (void)state;
    struct hall h;
    daemon_init_tokens(&h.d);
    open_hall(&h);
    struct peer *anna = &h.p[VIEWER], *bert = &h.p[EDITOR], *admin = &h.p[ADMIN];
    watch(admin, (struct hgp_scene_watch){.has_camera = true, .camera = true});
    const struct hgp_camera_request request = {0};
    peer_call(bert, HGP_T_camera_request, &request, HGP_T_ok);
    peer_call(anna, HGP_T_camera_request, &request, HGP_T_ok); // waits
    do
        await(admin, HGP_T_camera_state);
    while (admin->m.camera_state.waiting.count != 1);
    assert_int_equal(admin->m.camera_state.holder, bert->session);
    assert_int_equal(admin->m.camera_state.waiting.items[0].session, anna->session);
    peer_refused(anna, HGP_T_camera_give,
        &(struct hgp_camera_give){.has_session = true, .session = anna->session}, HG_E_PERM);
    peer_refused(bert, HGP_T_camera_give,
        &(struct hgp_camera_give){.has_session = true, .session = 4711}, HG_E_NOTFOUND);
    peer_call(bert, HGP_T_camera_give, &(struct hgp_camera_give){0}, HGP_T_ok); // to who waits
    await_holder(admin, anna->session, HGP_camera_change_RELEASED);
    peer_call(admin, HGP_T_camera_lock, &(struct hgp_camera_lock){.locked = true}, HGP_T_ok);
    peer_refused(bert, HGP_T_camera_take, &(struct hgp_camera_take){0}, HG_E_PERM);
    peer_refused(anna, HGP_T_camera_give, &(struct hgp_camera_give){0}, HG_E_PERM);
    peer_call(admin, HGP_T_camera_give,
        &(struct hgp_camera_give){.has_session = true, .session = bert->session}, HGP_T_ok);
    await_holder(admin, bert->session, HGP_camera_change_GIVEN);
    peer_call(admin, HGP_T_camera_lock, &(struct hgp_camera_lock){.locked = false}, HGP_T_ok);
    peer_close(bert); // who has it leaves
    await_holder(admin, 0, HGP_camera_change_LEFT);
    peer_close(anna);
    peer_close(admin);
    daemon_finish(&h.d);
}

static void inactive_and_greedy_holders_lose_it(void **state)
{
    (void)state;
    struct hall h;
    daemon_init_tokens(&h.d);
    daemon_option(&h.d, "camera-timeout", "0.4");
    daemon_option(&h.d, "camera-turn", "0.5");
    open_hall(&h);
    struct peer *anna = &h.p[VIEWER], *bert = &h.p[EDITOR], *admin = &h.p[ADMIN];
    const struct hgp_camera_request request = {0};
    watch(admin, (struct hgp_scene_watch){.has_camera = true, .camera = true});
    peer_call(anna, HGP_T_camera_request, &request, HGP_T_ok);
    await_holder(admin, anna->session, HGP_camera_change_REQUESTED);
    await_holder(admin, 0, HGP_camera_change_INACTIVE);
    // One that never stops moving it loses it to one that waits, and waits itself.
    follow(anna);
    peer_call(anna, HGP_T_camera_request, &request, HGP_T_ok);
    peer_call(bert, HGP_T_camera_request, &request, HGP_T_ok);
    uint64_t holder = 0;
    for (uint64_t seq = 1; holder != bert->session && seq < 400; seq++) {
        move(anna, seq);
        peer_call(anna, HGP_T_camera_request, &request, HGP_T_ok);
        while (peer_next_within(admin, 20))
            if (admin->header.type == HGP_T_camera_state)
                holder = admin->m.camera_state.holder;
    }
    assert_int_equal(holder, bert->session);
    close_hall(&h);
}

// ---- edits --------------------------------------------------------------------------------------

enum { EDITORS = 8, EDITS = 40, NODES = 7, ALL = EDITORS * EDITS };

static void await_edits(struct peer *p, struct hgp_edited out[ALL])
{
    for (int i = 0; i < ALL; i++) {
        await(p, HGP_T_edited);
        out[i] = p->m.edited;
    }
}

static void all_see_the_same_order(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p[EDITORS], clock;
    static struct hgp_edited first[ALL], other[ALL];
    daemon_begin(&d);
    for (int i = 0; i < EDITORS; i++) {
        peer_open_scene(&p[i], &d, "hall");
        for (uint32_t k = 0; i == 0 && k < NODES; k++)
            peer_call(
                &p[0], HGP_T_node_set, &(struct hgp_node_set){.node = p[0].first_id + k}, HGP_T_ok);
        watch(&p[i], (struct hgp_scene_watch){.has_edits = true, .edits = true});
    }
    peer_open_scene(&clock, &d, "hall");
    watch(&clock, (struct hgp_scene_watch){.has_edits = true, .edits = true});
    clock.m.edited.number = 0;
    for (uint32_t k = 0; k < EDITS; k++) {
        for (int i = 0; i < EDITORS; i++)
            peer_tell(&p[i], HGP_T_node_set,
                &(struct hgp_node_set){.node = p[0].first_id + k % NODES,
                    .has_translation = true,
                    .translation = {(float)i, 0, 0}});
        if (k % 13 != 5)
            continue;
        while (clock.m.edited.number < NODES + (k + 1) * EDITORS) // all that there is to blame
            await(&clock, HGP_T_edited);
        daemon_write(&d, "die.node_set", ""); // at the next one, with others under way
    }
    await_edits(&p[0], first);
    uint32_t of_session[EDITORS] = {0};
    for (int i = 0; i < ALL; i++) {
        assert_int_equal(first[i].number, NODES + i + 1);
        assert_int_equal(first[i].message, HGP_T_node_set);
        assert_true(i == 0 || first[i].revision >= first[i - 1].revision);
        for (int k = 0; k < EDITORS; k++)
            of_session[k] += first[i].session == p[k].session;
    }
    for (int k = 0; k < EDITORS; k++)
        assert_int_equal(of_session[k], EDITS); // each happened once
    for (int k = 1; k < EDITORS; k++) {
        await_edits(&p[k], other);
        assert_memory_equal(first, other, sizeof first);
    }
    for (int i = 0; i < EDITORS; i++)
        peer_close(&p[i]);
    peer_close(&clock);
    daemon_finish(&d);
}

// ---- annotations --------------------------------------------------------------------------------

static struct hgp_annotation_set note(const char *text)
{
    return (struct hgp_annotation_set){.has_position = true,
        .position = {1, 2, 3},
        .has_text = true,
        .text = hgp_str_make(text),
        .has_kind = true,
        .kind = HGP_annotation_kind_TEXT,
        .has_node = true,
        .node = 77};
}

static uint64_t annotate(struct peer *p, const char *text)
{
    struct hgp_annotation_set m = note(text);
    peer_call(p, HGP_T_annotation_set, &m, HGP_T_annotation);
    assert_int_equal(p->m.annotation.annotation.count, 1);
    assert_true(p->m.annotation.annotation.items[0].own);
    return p->m.annotation.annotation.items[0].annotation;
}

static uint32_t count_annotations(struct peer *p)
{
    peer_call(p, HGP_T_annotations_query, &(struct hgp_annotations_query){0}, HGP_T_annotations);
    return p->m.annotations.annotations.count;
}

static void annotations_belong_to_their_authors(void **state)
{
    (void)state;
    struct hall h;
    daemon_init_tokens(&h.d);
    open_hall(&h);
    struct peer *anna = &h.p[VIEWER], *bert = &h.p[EDITOR], *admin = &h.p[ADMIN];
    watch(admin, (struct hgp_scene_watch){.has_annotations = true, .annotations = true});
    const uint64_t of_anna = annotate(anna, "a crack"), of_bert = annotate(bert, "mine");
    await(admin, HGP_T_annotation);
    const struct hgp_annotation_entry *it = admin->m.annotation.annotation.items;
    assert_int_equal(it->annotation, of_anna);
    assert_false(it->own);
    assert_memory_equal(it->text.data, "a crack", it->text.size);
    assert_memory_equal(it->author.data, "anna", it->author.size);
    assert_true(it->position[1] == 2 && it->node == 77 && it->time_ms > 0);
    await(admin, HGP_T_annotation);
    struct hgp_annotation_set change = {
        .annotation = of_bert, .has_text = true, .text = hgp_str_make("hers?")};
    peer_refused(anna, HGP_T_annotation_set, &change, HG_E_PERM);
    peer_refused(anna, HGP_T_annotation_remove,
        &(struct hgp_annotation_remove){.annotation = of_bert}, HG_E_PERM);
    change.annotation = of_anna;
    peer_call(bert, HGP_T_annotation_set, &change, HGP_T_annotation);
    it = bert->m.annotation.annotation.items;
    assert_memory_equal(it->text.data, "hers?", it->text.size);
    assert_true(it->position[1] == 2); // what was not named stays
    assert_true(it->changed_ms >= it->time_ms);
    peer_call(anna, HGP_T_annotation_remove, &(struct hgp_annotation_remove){.annotation = of_anna},
        HGP_T_ok);
    await(admin, HGP_T_annotation_removed);
    assert_int_equal(admin->m.annotation_removed.annotation, of_anna);
    assert_int_equal(count_annotations(anna), 1);
    peer_refused(anna, HGP_T_annotation_remove,
        &(struct hgp_annotation_remove){.annotation = of_anna}, HG_E_NOTFOUND);
    struct hgp_annotation_set nowhere = {.annotation = 0};
    peer_refused(anna, HGP_T_annotation_set, &nowhere, HG_E_INVAL);
    close_hall(&h);
}

static void annotations_survive_a_kill(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    char folder[160];
    daemon_init(&d);
    snprintf(folder, sizeof folder, "%s/state", d.folder);
    daemon_option(&d, "state-dir", folder);
    daemon_start(&d);
    peer_open_scene(&p, &d, "hall");
    const uint64_t gone = annotate(&p, "one"), stays = annotate(&p, "two");
    const uint64_t newest = annotate(&p, "three");
    peer_call(
        &p, HGP_T_annotation_remove, &(struct hgp_annotation_remove){.annotation = gone}, HGP_T_ok);
    peer_call(&p, HGP_T_annotation_remove, &(struct hgp_annotation_remove){.annotation = newest},
        HGP_T_ok);
    for (int i = 0; i < 2; i++) { // the second time from what the first one had read
        daemon_signal(&d, SIGKILL);
        daemon_reap(&d);
        peer_close(&p);
        daemon_start(&d);
        peer_open_scene(&p, &d, "hall");
        assert_int_equal(count_annotations(&p), 1);
        const struct hgp_annotation_entry *it = p.m.annotations.annotations.items;
        assert_int_equal(it->annotation, stays);
        assert_memory_equal(it->text.data, "two", it->text.size);
        assert_memory_equal(it->author.data, "local", it->author.size);
        assert_true(it->own && it->position[2] == 3 && it->node == 77);
    }
    assert_true(annotate(&p, "four") > newest); // numbers are not given again
    peer_close(&p);
    daemon_finish(&d);
}

// The first frame that shows an input, and no other.
static void latencies_are_in_the_metrics(void **state)
{
    (void)state;
    static const char count[] = "heliod_input_latency_seconds_count{stage=\"all\"}";
    struct daemon d;
    struct peer p;
    daemon_init_tokens(&d);
    daemon_start(&d);
    peer_enter(&p, &d, "edit-token-1");
    peer_scene(&p, "hall");
    peer_view(&p, 1, 16, 16);
    peer_tell(&p, HGP_T_subscribe, &(struct hgp_subscribe){.view = 1, .credit_frames = 2});
    await(&p, HGP_T_frame);
    await(&p, HGP_T_frame);
    assert_int_equal((int)daemon_metric(&d, count), 0);
    peer_tell(&p, HGP_T_view_camera, &(struct hgp_view_camera){.view = 1, .input_seq = 5});
    peer_tell(&p, HGP_T_credit, &(struct hgp_credit){.view = 1, .frames = 3});
    for (int i = 0; i < 3; i++)
        await(&p, HGP_T_frame);
    assert_int_equal(p.m.frame.input_seq, 5);
    assert_true(p.m.frame.has_input_ns && p.m.frame.sent_ns >= p.m.frame.input_ns);
    assert_int_equal((int)daemon_metric(&d, count), 1);
    peer_close(&p);
    daemon_finish(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(latencies_are_in_the_metrics),
        cmocka_unit_test(tells_who_is_there),
        cmocka_unit_test(nothing_is_told_unasked),
        cmocka_unit_test(followers_see_what_the_holder_sees),
        cmocka_unit_test(camera_is_given_and_locked),
        cmocka_unit_test(inactive_and_greedy_holders_lose_it),
        cmocka_unit_test(all_see_the_same_order),
        cmocka_unit_test(annotations_belong_to_their_authors),
        cmocka_unit_test(annotations_survive_a_kill),
    };
    return cmocka_run_group_tests_name("people", tests, NULL, NULL);
}
