#include "server/worker/encode/frame_planes.h"

#include "protocol/hgp.h"

enum hg_status hg_frame_planes_decode(
    uint32_t bits, uint32_t *planes, uint32_t *mattes, struct hg_error *err)
{
    static const uint8_t known[] = {
        [HGP_plane_ALBEDO] = HG_PLANE_ALBEDO,
        [HGP_plane_NORMAL] = HG_PLANE_NORMAL,
        [HGP_plane_GEOMETRIC_NORMAL] = HG_PLANE_GEOMETRIC_NORMAL,
        [HGP_plane_DEPTH] = HG_PLANE_DEPTH,
        [HGP_plane_POSITION] = HG_PLANE_POSITION,
        [HGP_plane_EMISSION] = HG_PLANE_EMISSION,
        [HGP_plane_DIRECT_DIFFUSE] = HG_PLANE_DIRECT_DIFFUSE,
        [HGP_plane_DIRECT_SPECULAR] = HG_PLANE_DIRECT_SPECULAR,
        [HGP_plane_DIRECT_TRANSMISSION] = HG_PLANE_DIRECT_TRANSMISSION,
        [HGP_plane_INDIRECT_DIFFUSE] = HG_PLANE_INDIRECT_DIFFUSE,
        [HGP_plane_INDIRECT_SPECULAR] = HG_PLANE_INDIRECT_SPECULAR,
        [HGP_plane_INDIRECT_TRANSMISSION] = HG_PLANE_INDIRECT_TRANSMISSION,
        [HGP_plane_MOTION] = HG_PLANE_MOTION,
        [HGP_plane_OBJECT] = HG_PLANE_OBJECT,
        [HGP_plane_MATERIAL] = HG_PLANE_MATERIAL,
        [HGP_plane_SAMPLES] = HG_PLANE_SAMPLES,
        [HGP_plane_VARIANCE] = HG_PLANE_VARIANCE,
        [HGP_plane_LIGHT_GROUPS] = HG_PLANE_LIGHT_GROUPS,
        [HGP_plane_CRYPTO_OBJECT] = HG_PLANE_DRAWS,
        [HGP_plane_CRYPTO_MATERIAL] = HG_PLANE_DRAWS,
        [HGP_plane_CRYPTO_ASSET] = HG_PLANE_DRAWS,
        [HGP_plane_NOISY] = HG_PLANE_NOISY,
    };
    uint32_t found = 0;
    for (uint32_t i = 1; i < 32; i++) {
        if (!(bits >> i & 1))
            continue;
        if (i >= sizeof known || !known[i]) {
            const char *name = hgp_enum_name("plane", i);
            return hg_error_set(err, HG_E_UNSUPPORTED, "view_set", "planes",
                "%s is not kept by this renderer", name ? name : "?");
        }
        found |= 1u << known[i];
    }
    *planes = found;
    *mattes = (bits >> HGP_plane_CRYPTO_OBJECT & 1) << HG_MATTE_OBJECT |
              (bits >> HGP_plane_CRYPTO_MATERIAL & 1) << HG_MATTE_MATERIAL |
              (bits >> HGP_plane_CRYPTO_ASSET & 1) << HG_MATTE_ASSET;
    return HG_OK;
}
