// camera.c - camera conventions of the command line. Pure.
#include <math.h>
#include <string.h>

#include "client/include/helio/helio.h"

static const double degree = 3.14159265358979323846 / 180.0;

uint64_t helio_object_id(uint32_t asset, uint32_t index)
{
    return (uint64_t)asset << 32 | index;
}

void helio_camera_orbit(double theta_deg, double phi_deg, double radius, const double target[3],
    struct hgp_view_camera *camera)
{
    double theta = theta_deg * degree, phi = phi_deg * degree;
    double out[3] = {sin(phi) * sin(theta), cos(phi), sin(phi) * cos(theta)};
    double up[3] = {0, 1, 0};
    if (fabs(sin(phi)) < 1e-6) { // d(out)/d(phi), negated: where +Y goes as phi nears the pole
        up[0] = -cos(phi) * sin(theta);
        up[1] = 0;
        up[2] = -cos(phi) * cos(theta);
    }
    for (int i = 0; i < 3; i++) {
        double eye = target[i] + radius * out[i];
        camera->eye[i] = (float)eye;
        camera->target[i] = (float)(radius != 0 ? target[i] : eye - out[i]);
        camera->up[i] = (float)up[i];
    }
    camera->has_eye = camera->has_target = camera->has_up = true;
}

bool helio_view_angles(const char *name, double *azimuth_deg, double *elevation_deg)
{
    static const struct {
        const char *name;
        double azimuth, elevation;
    } views[] = {{"front", 0, 0}, {"back", 180, 0}, {"left", -90, 0}, {"right", 90, 0},
        {"top", 0, 90}, {"bottom", 0, -90}, {"iso", 45, 35.264389682754654}}; // atan(1 / sqrt 2)
    for (size_t i = 0; i < sizeof views / sizeof *views; i++) {
        if (strcmp(name, views[i].name) != 0)
            continue;
        *azimuth_deg = views[i].azimuth;
        *elevation_deg = views[i].elevation;
        return true;
    }
    return false;
}
