// test_view_pad.c - the gamepad of helio view, with a virtual one of SDL: what its sticks, triggers
// and buttons come to, and that it may come and go.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "client/view/controls.h"

static int pad_index = -1;

static int attach(void **state)
{
    (void)state;
    SDL_SetHint(SDL_HINT_JOYSTICK_ALLOW_BACKGROUND_EVENTS, "1"); // there is no window
    if (SDL_Init(SDL_INIT_GAMECONTROLLER) != 0)
        return -1;
    pad_index = SDL_JoystickAttachVirtual(
        SDL_JOYSTICK_TYPE_GAMECONTROLLER, SDL_CONTROLLER_AXIS_MAX, SDL_CONTROLLER_BUTTON_MAX, 0);
    return pad_index < 0 ? -1 : 0;
}

static int detach(void **state)
{
    (void)state;
    SDL_Quit();
    return 0;
}

// All events that wait, as the window takes them.
static void take(struct hg_controls *c)
{
    SDL_Event event;
    SDL_JoystickUpdate();
    while (SDL_PollEvent(&event))
        hg_controls_pad(c, &event);
}

static struct hg_navigate_wish wish_of(struct hg_controls *c)
{
    struct hg_navigate_wish wish;
    take(c);
    hg_controls_wish(c, false, &wish);
    return wish;
}

static void push(const struct hg_controls *c, SDL_GameControllerAxis axis, int value)
{
    SDL_Joystick *stick = SDL_GameControllerGetJoystick(c->pad);
    assert_int_equal(SDL_JoystickSetVirtualAxis(stick, axis, (Sint16)value), 0);
}

static void test_sticks_and_triggers(void **state)
{
    (void)state;
    struct hg_controls c = {0};
    take(&c);
    assert_non_null(c.pad);
    push(&c, SDL_CONTROLLER_AXIS_TRIGGERLEFT,
        INT16_MIN); // let go: 0 of a trigger is half of its way
    push(&c, SDL_CONTROLLER_AXIS_TRIGGERRIGHT, INT16_MIN);
    const struct hg_navigate_wish still = wish_of(&c);
    assert_true(still.right == 0 && still.forward == 0 && still.up == 0 && still.turn == 0 &&
                still.tilt == 0);

    push(&c, SDL_CONTROLLER_AXIS_LEFTX, INT16_MAX);
    push(&c, SDL_CONTROLLER_AXIS_LEFTY, -INT16_MAX); // away from oneself
    push(&c, SDL_CONTROLLER_AXIS_RIGHTX, -INT16_MAX);
    push(&c, SDL_CONTROLLER_AXIS_RIGHTY, -INT16_MAX);
    push(&c, SDL_CONTROLLER_AXIS_TRIGGERRIGHT, INT16_MAX);
    const struct hg_navigate_wish all = wish_of(&c);
    assert_true(all.right == 1 && all.forward == 1 && all.turn == -1 && all.tilt == 1);
    assert_true(all.up == 1 && all.fast == 1);

    push(&c, SDL_CONTROLLER_AXIS_TRIGGERLEFT, INT16_MAX); // both: neither up nor down
    push(&c, SDL_CONTROLLER_AXIS_LEFTX, INT16_MAX / 10);  // as a worn stick at rest
    const struct hg_navigate_wish some = wish_of(&c);
    assert_true(some.up == 0 && some.right == 0 && some.forward == 1);

    assert_int_equal(SDL_JoystickDetachVirtual(pad_index), 0);
    const struct hg_navigate_wish gone = wish_of(&c);
    assert_null(c.pad);
    assert_true(gone.forward == 0 && gone.turn == 0 && gone.tilt == 0 && gone.up == 0);
}

static void test_buttons(void **state)
{
    (void)state;
    assert_int_equal(
        hg_controls_button(SDL_CONTROLLER_BUTTON_A, HG_NAVIGATE_ORBIT), HG_VIEW_DO_FIT);
    assert_int_equal(
        hg_controls_button(SDL_CONTROLLER_BUTTON_B, HG_NAVIGATE_ORBIT), HG_VIEW_DO_FLY);
    assert_int_equal(hg_controls_button(SDL_CONTROLLER_BUTTON_B, HG_NAVIGATE_FLY), HG_VIEW_DO_WALK);
    assert_int_equal(
        hg_controls_button(SDL_CONTROLLER_BUTTON_B, HG_NAVIGATE_WALK), HG_VIEW_DO_ORBIT);
    assert_int_equal(hg_controls_button(SDL_CONTROLLER_BUTTON_X, HG_NAVIGATE_FLY), HG_VIEW_DO_MODE);
    assert_int_equal(
        hg_controls_button(SDL_CONTROLLER_BUTTON_GUIDE, HG_NAVIGATE_FLY), HG_VIEW_ACTION_COUNT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sticks_and_triggers),
        cmocka_unit_test(test_buttons),
    };
    return cmocka_run_group_tests(tests, attach, detach);
}
