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

void helio_camera_fit(const float min[3], const float max[3], double vfov_rad, double aspect,
    struct hgp_view_camera *camera)
{
    // From the front and 15 degrees above; the eight corners give the least distance.
    const double pitch = 15 * degree;
    const double back[3] = {0, sin(pitch), cos(pitch)}, up[3] = {0, cos(pitch), -sin(pitch)};
    double half_y = tan(vfov_rad / 2) * 0.92, half_x = half_y * aspect; // 8 % margin
    double center[3], distance = 0;
    for (int i = 0; i < 3; i++)
        center[i] = 0.5 * ((double)min[i] + (double)max[i]);
    for (int corner = 0; corner < 8; corner++) {
        double d[3];
        for (int i = 0; i < 3; i++)
            d[i] = (double)(corner >> i & 1 ? max[i] : min[i]) - center[i];
        double x = fabs(d[0]), y = fabs(d[1] * up[1] + d[2] * up[2]);
        double toward = d[1] * back[1] + d[2] * back[2];
        distance = fmax(distance, toward + fmax(x / half_x, y / half_y));
    }
    if (!(distance > 1e-6))
        distance = 1;
    for (int i = 0; i < 3; i++) {
        camera->target[i] = (float)center[i];
        camera->eye[i] = (float)(center[i] + distance * back[i]);
        camera->up[i] = i == 1 ? 1 : 0;
    }
    camera->vfov_rad = (float)vfov_rad;
    camera->has_eye = camera->has_target = camera->has_up = camera->has_vfov_rad = true;
}
