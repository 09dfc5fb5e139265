// controls.c - keys, pointer and gamepad to actions.
#include "client/view/controls.h"

#include <string.h>

const struct hg_view_key hg_view_keys[HG_VIEW_ACTION_COUNT] = {
#define HG_VIEW_KEY(action, key, code, name, doc) {HG_VIEW_DO_##action, key, code, name, doc},
#include "client/view/keys.def"
};

const struct hg_view_row hg_view_pointer_rows[] = {
#define HG_VIEW_POINTER(what, doc) {what, doc},
#include "client/view/keys.def"
};

const struct hg_view_row hg_view_panel_rows[] = {
#define HG_VIEW_PANEL(what, doc) {what, doc},
#include "client/view/keys.def"
};

const struct hg_view_row hg_view_pad_rows[] = {
#define HG_VIEW_PAD(what, doc) {what, doc},
#include "client/view/keys.def"
};

const uint32_t hg_view_pointer_row_count =
    sizeof hg_view_pointer_rows / sizeof *hg_view_pointer_rows;
const uint32_t hg_view_panel_row_count = sizeof hg_view_panel_rows / sizeof *hg_view_panel_rows;
const uint32_t hg_view_pad_row_count = sizeof hg_view_pad_rows / sizeof *hg_view_pad_rows;

enum hg_view_action hg_controls_find(SDL_Scancode key, bool *moves)
{
    for (int i = 0; i < HG_VIEW_ACTION_COUNT; i++)
        if (SDL_GetScancodeFromName(hg_view_keys[i].name) == key) {
            *moves = hg_view_keys[i].action <= HG_VIEW_DO_ZOOM_OUT;
            return hg_view_keys[i].action;
        }
    *moves = false;
    return HG_VIEW_ACTION_COUNT;
}

void hg_controls_release(struct hg_controls *c)
{
    memset(c->held, 0, sizeof c->held);
}

static double both(const struct hg_controls *c, enum hg_view_action less, enum hg_view_action more)
{
    return (double)c->held[more] - (double)c->held[less];
}

static double sum(double a, double b)
{
    const double s = a + b;
    return s > 1 ? 1 : s < -1 ? -1 : s;
}

void hg_controls_wish(const struct hg_controls *c, bool fast, struct hg_navigate_wish *wish)
{
    wish->right = sum(both(c, HG_VIEW_DO_LEFT, HG_VIEW_DO_RIGHT), c->move[0]);
    wish->forward = sum(sum(both(c, HG_VIEW_DO_BACK, HG_VIEW_DO_FORWARD),
                            both(c, HG_VIEW_DO_ZOOM_OUT, HG_VIEW_DO_ZOOM_IN)),
        -c->move[1]);
    wish->up = sum(both(c, HG_VIEW_DO_DOWN, HG_VIEW_DO_UP), c->lift);
    wish->turn = sum(both(c, HG_VIEW_DO_TURN_LEFT, HG_VIEW_DO_TURN_RIGHT), c->look[0]);
    wish->tilt = sum(both(c, HG_VIEW_DO_TILT_DOWN, HG_VIEW_DO_TILT_UP), -c->look[1]);
    wish->fast = fast ? 4 : 1;
}

static double axis(SDL_GameController *pad, SDL_GameControllerAxis which)
{
    return hg_navigate_axis(SDL_GameControllerGetAxis(pad, which));
}

void hg_controls_pad(struct hg_controls *c, const SDL_Event *event)
{
    if (event->type == SDL_CONTROLLERDEVICEADDED && !c->pad)
        c->pad = SDL_GameControllerOpen(event->cdevice.which);
    if (!c->pad)
        return;
    if (event->type == SDL_CONTROLLERDEVICEREMOVED &&
        event->cdevice.which == SDL_JoystickInstanceID(SDL_GameControllerGetJoystick(c->pad))) {
        hg_controls_finish(c);
        c->move[0] = c->move[1] = c->look[0] = c->look[1] = c->lift = 0;
    } else if (event->type == SDL_CONTROLLERAXISMOTION) {
        c->move[0] = axis(c->pad, SDL_CONTROLLER_AXIS_LEFTX);
        c->move[1] = axis(c->pad, SDL_CONTROLLER_AXIS_LEFTY);
        c->look[0] = axis(c->pad, SDL_CONTROLLER_AXIS_RIGHTX);
        c->look[1] = axis(c->pad, SDL_CONTROLLER_AXIS_RIGHTY);
        c->lift = axis(c->pad, SDL_CONTROLLER_AXIS_TRIGGERRIGHT) -
                  axis(c->pad, SDL_CONTROLLER_AXIS_TRIGGERLEFT);
    }
}

enum hg_view_action hg_controls_button(int button, enum hg_navigate_style style)
{
    static const enum hg_view_action next[] = {[HG_NAVIGATE_ORBIT] = HG_VIEW_DO_FLY,
        [HG_NAVIGATE_FLY] = HG_VIEW_DO_WALK,
        [HG_NAVIGATE_WALK] = HG_VIEW_DO_ORBIT};
    switch (button) {
    case SDL_CONTROLLER_BUTTON_A:
        return HG_VIEW_DO_FIT;
    case SDL_CONTROLLER_BUTTON_B:
        return next[style];
    case SDL_CONTROLLER_BUTTON_X:
        return HG_VIEW_DO_MODE;
    case SDL_CONTROLLER_BUTTON_Y:
        return HG_VIEW_DO_VARIANT;
    case SDL_CONTROLLER_BUTTON_RIGHTSHOULDER:
        return HG_VIEW_DO_CAMERA;
    case SDL_CONTROLLER_BUTTON_START:
        return HG_VIEW_DO_HELP;
    case SDL_CONTROLLER_BUTTON_BACK:
        return HG_VIEW_DO_STATISTICS;
    default:
        return HG_VIEW_ACTION_COUNT;
    }
}

void hg_controls_finish(struct hg_controls *c)
{
    if (c->pad)
        SDL_GameControllerClose(c->pad);
    c->pad = NULL;
}
