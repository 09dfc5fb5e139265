// measure.h - measuring between two points of the scene. Floor 6 (client). Pure; metres, world
// space.
#ifndef HG_CLIENT_VIEW_MEASURE_H
#define HG_CLIENT_VIEW_MEASURE_H

#include <stddef.h>
#include <stdint.h>

struct hg_measure {
    uint32_t count; // points so far, at most 2
    double points[2][3], normals[2][3];
};

// With two points there already, the next one starts a new measurement.
void hg_measure_add(struct hg_measure *r, const float point[3], const float normal[3]);
double hg_measure_distance(const struct hg_measure *r); // 0 with less than two points
// Between the surfaces at the points, degrees; 0 where one of them has no normal.
double hg_measure_angle_deg(const struct hg_measure *r);
// "2.000 m", "12.30 cm", "1.250 km": as the browser viewer writes lengths.
void hg_measure_text(double metres, char *text, size_t size);

#endif
