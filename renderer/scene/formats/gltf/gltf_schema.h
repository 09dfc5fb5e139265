// gltf_schema.h - the shape of a glTF document as data: names, types, limits, references.
// Floor 2, private to scene/. Source: the glTF 2.0 JSON schema and those of the extensions.
#ifndef HG_RENDERER_SCENE_FORMATS_GLTF_GLTF_SCHEMA_H
#define HG_RENDERER_SCENE_FORMATS_GLTF_GLTF_SCHEMA_H

#include <stdint.h>

enum hg_schema_type {
    HG_SCHEMA_OBJECT,  // `child`
    HG_SCHEMA_STRING,  // `values`: permitted ones, separated by spaces
    HG_SCHEMA_NUMBER,  // within low..high
    HG_SCHEMA_INTEGER, // within low..high
    HG_SCHEMA_BOOLEAN,
    HG_SCHEMA_INDEX,   // into the root array `values`
    HG_SCHEMA_INDEXES, // array of such, low..high of them
    HG_SCHEMA_NUMBERS, // array of low..high numbers
    HG_SCHEMA_STRINGS, // array
    HG_SCHEMA_OBJECTS, // array of `child`
    HG_SCHEMA_MAP,     // object of indices into `values` (attributes)
};

enum {
    HG_SCHEMA_REQUIRED = 1,
    HG_SCHEMA_SOFT = 2, // a wrong type is only warned about: nothing depends on it
};

struct hg_schema_member {
    const char *name;
    uint8_t type, flags;
    double low, high; // 0, 0: no limits
    const char *values;
    const struct hg_schema_object *child;
};

struct hg_schema_object {
    const struct hg_schema_member *members; // ends with a NULL name
};

extern const struct hg_schema_object hg_gltf_schema;

// Object schema of an extension on a host ("material", "node", ...); NULL: not read by us.
const struct hg_schema_object *hg_gltf_extension_schema(const char *name);

#endif
