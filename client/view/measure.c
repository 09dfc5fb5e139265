// measure.c - measuring between two points. Pure.
#include "client/view/measure.h"

#include <math.h>
#include <stdio.h>

void hg_measure_add(struct hg_measure *r, const float point[3], const float normal[3])
{
    if (r->count >= 2)
        r->count = 0;
    for (int i = 0; i < 3; i++) {
        r->points[r->count][i] = point[i];
        r->normals[r->count][i] = normal[i];
    }
    r->count++;
}

double hg_measure_distance(const struct hg_measure *r)
{
    double sum = 0;
    for (int i = 0; i < 3 && r->count == 2; i++)
        sum += (r->points[1][i] - r->points[0][i]) * (r->points[1][i] - r->points[0][i]);
    return sqrt(sum);
}

double hg_measure_angle_deg(const struct hg_measure *r)
{
    double along = 0, lengths[2] = {0};
    for (int i = 0; i < 3 && r->count == 2; i++) {
        along += r->normals[0][i] * r->normals[1][i];
        for (int k = 0; k < 2; k++)
            lengths[k] += r->normals[k][i] * r->normals[k][i];
    }
    const double length = sqrt(lengths[0] * lengths[1]);
    const double cosine = length > 0 ? along / length : 1;
    return acos(cosine < -1 ? -1 : cosine > 1 ? 1 : cosine) * 180 / 3.14159265358979323846;
}

void hg_measure_text(double metres, char *text, size_t size)
{
    const double m = fabs(metres);
    if (m >= 1000)
        snprintf(text, size, "%.3f km", metres / 1000);
    else if (m >= 1 || m == 0)
        snprintf(text, size, "%.3f m", metres);
    else if (m >= 0.01)
        snprintf(text, size, "%.2f cm", metres * 100);
    else
        snprintf(text, size, "%.3f mm", metres * 1000);
}
