// overlay.c - text over the picture.
#include "client/view/overlay.h"

#include <SDL_ttf.h>
#include <fontconfig/fontconfig.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

enum { MARGIN = HG_OVERLAY_MARGIN, PADDING = HG_OVERLAY_PADDING };

// ---- the font ----------------------------------------------------------------------------------

static bool find_font(char *path, size_t size)
{
    FcResult result;
    FcChar8 *file = NULL;
    FcPattern *wanted = FcNameParse((const FcChar8 *)"monospace:scalable=true:slant=0");
    if (!wanted)
        return false;
    FcConfigSubstitute(NULL, wanted, FcMatchPattern);
    FcDefaultSubstitute(wanted);
    FcPattern *found = FcFontMatch(NULL, wanted, &result);
    const bool has = found && FcPatternGetString(found, FC_FILE, 0, &file) == FcResultMatch;
    if (has)
        snprintf(path, size, "%s", (const char *)file);
    if (found)
        FcPatternDestroy(found);
    FcPatternDestroy(wanted);
    return has;
}

static enum hg_status make_glyphs(struct hg_overlay *o, TTF_Font *font, struct hg_error *err)
{
    const SDL_Color white = {255, 255, 255, 255};
    char text[HG_OVERLAY_GLYPHS + 1];
    for (int i = 0; i < HG_OVERLAY_GLYPHS; i++)
        text[i] = (char)(HG_OVERLAY_FIRST + i);
    text[HG_OVERLAY_GLYPHS] = 0;
    SDL_Surface *drawn = TTF_RenderUTF8_Blended(font, text, white);
    o->glyphs = drawn ? SDL_CreateTextureFromSurface(o->renderer, drawn) : NULL;
    if (o->glyphs) {
        o->advance = drawn->w / HG_OVERLAY_GLYPHS;
        o->height = drawn->h;
    }
    SDL_FreeSurface(drawn);
    return o->glyphs ? HG_OK : hg_error_set(err, HG_E_NOMEM, "font", NULL, "%s", SDL_GetError());
}

enum hg_status hg_overlay_init(
    struct hg_overlay *o, SDL_Renderer *renderer, int size_px, struct hg_error *err)
{
    char path[4096];
    *o = (struct hg_overlay){.renderer = renderer};
    if (!find_font(path, sizeof path))
        return hg_error_set(err, HG_E_NOTFOUND, "font", NULL,
            "no monospaced font is installed (fonts-dejavu-core): no text is shown");
    if (TTF_Init())
        return hg_error_set(err, HG_E_NOTFOUND, "font", NULL, "%s", TTF_GetError());
    TTF_Font *font = TTF_OpenFont(path, size_px);
    if (font)
        TTF_SetFontKerning(font, 0);
    enum hg_status status =
        font ? make_glyphs(o, font, err)
             : hg_error_set(err, HG_E_NOTFOUND, path, NULL, "%s", TTF_GetError());
    if (font)
        TTF_CloseFont(font);
    TTF_Quit();
    return status;
}

void hg_overlay_finish(struct hg_overlay *o)
{
    if (o->glyphs)
        SDL_DestroyTexture(o->glyphs);
    *o = (struct hg_overlay){0};
}

// ---- lines -------------------------------------------------------------------------------------

void hg_overlay_add(struct hg_overlay_text *text, enum hg_overlay_tone tone, const char *fmt, ...)
{
    if (text->count == HG_OVERLAY_LINES_MAX)
        return;
    va_list args;
    va_start(args, fmt);
    vsnprintf(text->lines[text->count].text, HG_OVERLAY_LINE_BYTES, fmt, args);
    va_end(args);
    text->lines[text->count++].tone = tone;
}

void hg_overlay_wrap(
    struct hg_overlay_text *text, enum hg_overlay_tone tone, const char *words, int columns)
{
    const size_t most = columns < 16 ? 16 : (size_t)columns;
    while (*words) {
        size_t n = strlen(words);
        if (n > most) {
            n = most;
            while (n > most / 2 && words[n] != ' ')
                n--;
        }
        hg_overlay_add(text, tone, "%.*s", (int)n, words);
        words += n;
        words += strspn(words, " ");
    }
}

// ---- drawing -----------------------------------------------------------------------------------

static void draw_line(const struct hg_overlay *o, const struct hg_overlay_line *line, int advance,
    int height, int x, int y)
{
    const char *text = line->text;
    static const Uint8 colors[][3] = {
        {240, 240, 240}, {165, 172, 180}, {150, 220, 150}, {255, 150, 130}};
    SDL_SetTextureColorMod(
        o->glyphs, colors[line->tone][0], colors[line->tone][1], colors[line->tone][2]);
    for (; *text; text++, x += advance) {
        const unsigned char c = (unsigned char)*text;
        if ((c & 0xc0) == 0x80) { // the first byte of the character stands for all of it
            x -= advance;
            continue;
        }
        const int glyph =
            (c < HG_OVERLAY_FIRST || c >= HG_OVERLAY_FIRST + HG_OVERLAY_GLYPHS ? '?' : c) -
            HG_OVERLAY_FIRST;
        const SDL_Rect from = {glyph * o->advance, 0, o->advance, o->height};
        const SDL_Rect to = {x, y, advance, height};
        SDL_RenderCopy(o->renderer, o->glyphs, &from, &to);
    }
}

static int columns_of(const struct hg_overlay_text *text)
{
    size_t most = 0;
    for (uint32_t i = 0; i < text->count; i++) {
        const size_t n = strlen(text->lines[i].text);
        most = n > most ? n : most;
    }
    return (int)most;
}

// Smaller than the font where the lines would not fit.
static struct hg_overlay fit(
    const struct hg_overlay *o, const struct hg_overlay_text *text, int width, int height)
{
    struct hg_overlay small = *o;
    const int room_x = width - 2 * (MARGIN + PADDING), room_y = height - 2 * (MARGIN + PADDING);
    const int w = columns_of(text) * o->advance, h = (int)text->count * o->height;
    double scale = w > room_x ? (double)room_x / w : 1;
    if (h * scale > room_y)
        scale = (double)room_y / h;
    small.advance = scale < 1 ? (int)(o->advance * scale) : o->advance;
    small.height = scale < 1 ? (int)(o->height * scale) : o->height;
    return small;
}

void hg_overlay_box(const struct hg_overlay *o, const SDL_Rect *box)
{
    SDL_SetRenderDrawBlendMode(o->renderer, SDL_BLENDMODE_BLEND);
    SDL_SetRenderDrawColor(o->renderer, 16, 18, 22, 190);
    SDL_RenderFillRect(o->renderer, box);
}

void hg_overlay_draw(const struct hg_overlay *o, const struct hg_overlay_text *text,
    enum hg_overlay_place place, int width, int height)
{
    if (!o->glyphs || text->count == 0)
        return;
    const struct hg_overlay f = fit(o, text, width, height);
    SDL_Rect box = {MARGIN, MARGIN, columns_of(text) * f.advance + 2 * PADDING,
        (int)text->count * f.height + 2 * PADDING};
    if (place == HG_OVERLAY_BOTTOM || place == HG_OVERLAY_MIDDLE)
        box.x = (width - box.w) / 2;
    if (place == HG_OVERLAY_BOTTOM || place == HG_OVERLAY_BOTTOM_LEFT)
        box.y = height - box.h - MARGIN;
    if (place == HG_OVERLAY_MIDDLE)
        box.y = (height - box.h) / 2;
    hg_overlay_box(o, &box);
    for (uint32_t i = 0; i < text->count; i++)
        draw_line(o, &text->lines[i], f.advance, f.height, box.x + PADDING,
            box.y + PADDING + (int)i * f.height);
}

void hg_overlay_put(const struct hg_overlay *o, enum hg_overlay_tone tone, const char *text,
    int columns, const SDL_Point *at)
{
    struct hg_overlay_line line = {.tone = tone};
    if (!o->glyphs || columns <= 0)
        return;
    snprintf(line.text, sizeof line.text, "%.*s", columns, text);
    draw_line(o, &line, o->advance, o->height, at->x, at->y);
}
