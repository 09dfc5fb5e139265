// The public header from C++, the shared library from outside: compiles, links and answers.
#include "client/include/helio/helio.h"

#include <cstdio>

int main()
{
    helio *connection = nullptr;
    hg_error err = {};
    helio_options options = {};
    options.url = "ftp:nowhere";
    hg_status status = helio_connect(&options, &connection, &err);
    hgp_view_camera camera = {};
    const double target[3] = {1, 2, 3};
    helio_camera_orbit(0, 90, 1, target, &camera);
    uint32_t value = 0;
    bool known = hgp_enum_value("tonemap", "pbr-neutral", &value);
    std::printf("%s: %s\n", hg_status_name(status), err.reason);
    return status == HG_E_INVAL && !connection && camera.eye[2] == 4 && known && value == 2 ? 0 : 1;
}
