// overlay.h - text over the picture: a monospaced font of the system, as one texture of glyphs.
// Floor 6 (client). Thread: that of the window.
#ifndef HG_CLIENT_VIEW_OVERLAY_H
#define HG_CLIENT_VIEW_OVERLAY_H

#include <SDL.h>

#include "base/status.h"

enum { HG_OVERLAY_FIRST = 32, HG_OVERLAY_GLYPHS = 95 }; // printable ASCII; others are '?'

struct hg_overlay {
    SDL_Renderer *renderer; // borrowed
    SDL_Texture *glyphs;    // NULL: there is no font, and nothing is drawn
    int advance, height;    // px of a character and of a line
};

enum hg_overlay_tone { HG_OVERLAY_PLAIN, HG_OVERLAY_DIM, HG_OVERLAY_GOOD, HG_OVERLAY_BAD };

// Finds a monospaced font. Without one (HG_E_NOTFOUND) the overlay draws nothing. `size_px`: of the
// characters.
enum hg_status hg_overlay_init(
    struct hg_overlay *o, SDL_Renderer *renderer, int size_px, struct hg_error *err) HG_MUST_CHECK;
void hg_overlay_finish(struct hg_overlay *o); // accepts a zeroed one

// Where lines of text stand: a box that is filled in behind them.
enum hg_overlay_place {
    HG_OVERLAY_TOP_LEFT,
    HG_OVERLAY_BOTTOM_LEFT,
    HG_OVERLAY_BOTTOM,
    HG_OVERLAY_MIDDLE
};
enum { HG_OVERLAY_MARGIN = 10, HG_OVERLAY_PADDING = 8 }; // px outside, inside of boxes

enum { HG_OVERLAY_LINES_MAX = 64, HG_OVERLAY_LINE_BYTES = 240 };

struct hg_overlay_line {
    char text[HG_OVERLAY_LINE_BYTES];
    enum hg_overlay_tone tone;
};

struct hg_overlay_text {
    uint32_t count;
    struct hg_overlay_line lines[HG_OVERLAY_LINES_MAX];
};

// Appends a line; what does not fit is left out.
void hg_overlay_add(struct hg_overlay_text *text, enum hg_overlay_tone tone, const char *fmt, ...)
    __attribute__((format(printf, 3, 4)));
// Appends a text broken at blanks into lines of at most `columns` characters.
void hg_overlay_wrap(
    struct hg_overlay_text *text, enum hg_overlay_tone tone, const char *words, int columns);
// Draws a box with the lines into a picture of `width` x `height` px, smaller where they do not
// fit.
void hg_overlay_draw(const struct hg_overlay *o, const struct hg_overlay_text *text,
    enum hg_overlay_place place, int width, int height);

// Parts of panels: the background of one, and a line of text of at most `columns` bytes.
void hg_overlay_box(const struct hg_overlay *o, const SDL_Rect *box);
void hg_overlay_put(const struct hg_overlay *o, enum hg_overlay_tone tone, const char *text,
    int columns, const SDL_Point *at);

#endif
