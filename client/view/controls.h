// controls.h - keys, pointer and gamepad to actions of the viewer. Floor 6 (client). Pure but for
// the names of keys, which SDL knows. Thread: that of the window.
#ifndef HG_CLIENT_VIEW_CONTROLS_H
#define HG_CLIENT_VIEW_CONTROLS_H

#include <SDL.h>

#include "client/view/navigate.h"

enum hg_view_action {
#define HG_VIEW_KEY(action, key, code, name, doc) HG_VIEW_DO_##action,
#include "client/view/keys.def"
    HG_VIEW_ACTION_COUNT
};

struct hg_view_key {
    enum hg_view_action action;
    const char *key, *code, *name, *doc;
};
extern const struct hg_view_key hg_view_keys[HG_VIEW_ACTION_COUNT];

// Rows of the help that are no keys.
struct hg_view_row {
    const char *what, *doc;
};
extern const struct hg_view_row hg_view_pointer_rows[], hg_view_panel_rows[], hg_view_pad_rows[];
extern const uint32_t hg_view_pointer_row_count, hg_view_panel_row_count, hg_view_pad_row_count;

struct hg_controls {
    bool held[HG_VIEW_ACTION_COUNT]; // of the keys that move
    double move[2], look[2], lift;   // of the gamepad, -1 to 1
    SDL_GameController *pad;         // NULL: none
};

// The action of a key; HG_VIEW_ACTION_COUNT: none. *moves: it counts as long as it is held.
enum hg_view_action hg_controls_find(SDL_Scancode key, bool *moves);
// Keys are let go when the window loses the keyboard.
void hg_controls_release(struct hg_controls *c);
// What is held now, keys and sticks together, each at most 1.
void hg_controls_wish(const struct hg_controls *c, bool fast, struct hg_navigate_wish *wish);
// A gamepad came, went, or was moved.
void hg_controls_pad(struct hg_controls *c, const SDL_Event *event);
// What a button of the gamepad does; HG_VIEW_ACTION_COUNT: nothing. `style`: the current one.
enum hg_view_action hg_controls_button(int button, enum hg_navigate_style style);
void hg_controls_finish(struct hg_controls *c);

#endif
