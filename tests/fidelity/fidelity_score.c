// fidelity_score.c - pictures in, distances and strips out; driven by fidelity.py.
//
//   fidelity_score sizes FILE...
//       WIDTH HEIGHT of WebP files, a line each, "0 0" = unreadable
//
//   fidelity_score compare WxH STRIP OURS FIRST FILE...
//       makes FIRST a thumb like the others (size WxH, through WebP at quality 90), saves it as
//       OURS, prints the matrix of distances in dB (FIRST and all FILEs, one row per line) and
//       draws a strip: the pictures in order, below each of them its difference from FIRST
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/file.h"
#include "renderer/image/image.h"
#include "tests/fidelity/score.h"

enum { max_pictures = 32, strip_cell_px = 256, thumb_quality = 90 };

static void die(const struct hg_error *err)
{
    char text[700];
    hg_error_format(err, text, sizeof text);
    fprintf(stderr, "%s\n", text);
    exit(1);
}

static struct hg_image load(const char *path)
{
    struct hg_image image;
    struct hg_error err = {0};
    const size_t length = strlen(path);
    const bool webp = length > 5 && strcmp(path + length - 5, ".webp") == 0;
    if (webp ? score_read_webp(path, &image, &err)
             : hg_image_read_file(path, HG_PIXEL_RGBA8, NULL, &image, &err))
        die(&err);
    return image;
}

static void save(const struct hg_image *image, const char *path)
{
    struct hg_writer w = {0};
    struct hg_error err = {0};
    struct hg_image_encode params = {.file = HG_IMAGE_PNG8};
    if (hg_image_encode(image, &params, &w, &err) ||
        hg_file_write_atomic(path, w.data, w.size, &err))
        die(&err);
    hg_writer_finish(&w);
}

static int print_sizes(int count, char **paths)
{
    for (int i = 0; i < count; i++) {
        struct score_webp webp;
        if (score_open_webp(paths[i], &webp, NULL))
            printf("0 0\n");
        else
            printf("%u %u\n", webp.width, webp.height);
        score_close_webp(&webp);
    }
    return 0;
}

static void put_pixel(struct hg_image *strip, uint32_t x, uint32_t y, const double rgb[3])
{
    uint8_t *px = (uint8_t *)strip->pixels + ((size_t)y * strip->width + x) * 4;
    for (int c = 0; c < 3; c++)
        px[c] = (uint8_t)fmin(fmax(rgb[c] + 0.5, 0), 255);
    px[3] = 255;
}

// Lays a picture over a chequered ground, so that its alpha shows.
static void draw_picture(struct hg_image *strip, uint32_t left, const struct hg_image *image)
{
    const uint8_t *px = image->pixels;
    for (uint32_t y = 0; y < image->height; y++)
        for (uint32_t x = 0; x < image->width; x++, px += 4) {
            double ground = (x / 16 + y / 16) % 2 ? 255 : 225, rgb[3];
            for (int c = 0; c < 3; c++)
                rgb[c] = ground + (px[c] - ground) * px[3] / 255.0;
            put_pixel(strip, left + x, y, rgb);
        }
}

// Signed difference over white, four times: grey is equal, brighter means FIRST is brighter.
static void draw_difference(struct hg_image *strip, uint32_t left, const struct hg_image *first,
    const struct hg_image *image)
{
    const uint8_t *a = first->pixels, *b = image->pixels;
    for (uint32_t y = 0; y < image->height; y++)
        for (uint32_t x = 0; x < image->width; x++, a += 4, b += 4) {
            double rgb[3];
            for (int c = 0; c < 3; c++) {
                double va = 255 + (a[c] - 255) * a[3] / 255.0;
                double vb = 255 + (b[c] - 255) * b[3] / 255.0;
                rgb[c] = 128 + 4 * (va - vb);
            }
            put_pixel(strip, left + x, image->height + y, rgb);
        }
}

static void draw_strip(const char *path, const struct hg_image *pictures, int count)
{
    struct hg_image strip, cells[max_pictures];
    uint32_t width = strip_cell_px;
    uint32_t height = (pictures[0].height * width + pictures[0].width / 2) / pictures[0].width;
    if (hg_image_create(width * (uint32_t)count, height * 2, HG_PIXEL_RGBA8, NULL, &strip))
        exit(1);
    for (int i = 0; i < count; i++) {
        score_resize(&pictures[i], width, height, &cells[i]);
        draw_picture(&strip, width * (uint32_t)i, &cells[i]);
        draw_difference(&strip, width * (uint32_t)i, &cells[0], &cells[i]);
    }
    save(&strip, path);
    for (int i = 0; i < count; i++)
        hg_image_finish(&cells[i]);
    hg_image_finish(&strip);
}

static void load_all(
    struct hg_image *pictures, uint32_t width, uint32_t height, int count, char **paths)
{
    struct hg_image first = load(paths[0]);
    score_resize(&first, width, height, &pictures[0]);
    if (!score_as_webp(&pictures[0], thumb_quality))
        exit(1);
    hg_image_finish(&first);
    for (int i = 1; i < count; i++) {
        pictures[i] = load(paths[i]);
        if (pictures[i].width != width || pictures[i].height != height) {
            fprintf(stderr, "%s is %ux%u px, not %ux%u\n", paths[i], pictures[i].width,
                pictures[i].height, width, height);
            exit(1);
        }
    }
}

// The same in both directions.
static void print_matrix(const struct hg_image *pictures, int count)
{
    double db[max_pictures][max_pictures];
    for (int i = 0; i < count; i++) {
        db[i][i] = -100;
        for (int j = i + 1; j < count; j++)
            db[i][j] = db[j][i] = score_distance(&pictures[i], &pictures[j]);
    }
    for (int i = 0; i < count; i++)
        for (int j = 0; j < count; j++)
            printf("%.4f%c", db[i][j], j + 1 < count ? ' ' : '\n');
}

static int compare(const char *size, const char *strip, const char *ours, int count, char **paths)
{
    struct hg_image pictures[max_pictures];
    unsigned width, height;
    if (sscanf(size, "%ux%u", &width, &height) != 2 || count > max_pictures)
        return 2;
    load_all(pictures, width, height, count, paths);
    save(&pictures[0], ours);
    print_matrix(pictures, count);
    draw_strip(strip, pictures, count);
    for (int i = 0; i < count; i++)
        hg_image_finish(&pictures[i]);
    return 0;
}

int main(int argc, char **argv)
{
    if (argc > 2 && strcmp(argv[1], "sizes") == 0)
        return print_sizes(argc - 2, argv + 2);
    if (argc > 6 && strcmp(argv[1], "compare") == 0)
        return compare(argv[2], argv[3], argv[4], argc - 5, argv + 5);
    fprintf(stderr, "usage: see the head of tests/fidelity/fidelity_score.c\n");
    return 2;
}
