#include "tests/attack/loading.h"

#include <ctype.h>
#include <dirent.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum { LAMPS = 30000 };

const char loading_head[] =
    "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" "
    "version=\"1.4.1\"><asset><unit meter=\"1\"/></asset>";
const char loading_geometry[] =
    "<library_geometries><geometry id=\"G\"><mesh><source id=\"P\"><float_array id=\"A\" "
    "count=\"%s\">0 0 0 1 0 0 0 1 0</float_array><technique_common><accessor source=\"#A\" "
    "count=\"3\" stride=\"3\"><param name=\"X\" type=\"float\"/><param name=\"Y\" type=\"float\"/>"
    "<param name=\"Z\" type=\"float\"/></accessor></technique_common></source><vertices id=\"V\">"
    "<input semantic=\"POSITION\" source=\"#P\"/></vertices><triangles count=\"1\"><input "
    "semantic=\"VERTEX\" source=\"#V\" offset=\"0\"/><p>0 1 2</p></triangles></mesh></geometry>"
    "</library_geometries>";
const char loading_leaf[] = "<node id=\"n\"><instance_geometry url=\"#G\"/></node>";
const char loading_tail[] = "</visual_scene></library_visual_scenes><scene><instance_visual_scene "
                            "url=\"#S\"/></scene></COLLADA>";
const char loading_opening[] = "<library_visual_scenes><visual_scene id=\"S\">";

// Lamps, whose nodes are looked for by name among all nodes.
void loading_write_slow(const char *path)
{
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    fputs(loading_head, file);
    fprintf(file, loading_geometry, "9");
    fputs("<library_lights>", file);
    for (int i = 0; i < LAMPS; i++)
        fprintf(file,
            "<light id=\"l%d\"><technique_common><point><color>1 1 1</color></point>"
            "</technique_common></light>",
            i);
    fprintf(file, "</library_lights>%s%s", loading_opening, loading_leaf);
    for (int i = 0; i < LAMPS; i++)
        fprintf(file,
            "<node id=\"a node with a long name %d\" name=\"a node with a long name %d\">"
            "<instance_light url=\"#l%d\"/></node>",
            i, i, i);
    fputs(loading_tail, file);
    assert_int_equal(fclose(file), 0);
}

int loading_count(pid_t parent, pid_t *last)
{
    int count = 0;
    DIR *folder = opendir("/proc");
    assert_non_null(folder);
    for (struct dirent *entry; (entry = readdir(folder));) {
        char path[300], line[200] = "";
        int pid = atoi(entry->d_name), of = 0;
        snprintf(path, sizeof path, "/proc/%s/stat", entry->d_name);
        FILE *file = isdigit((unsigned char)*entry->d_name) ? fopen(path, "r") : NULL;
        if (!file)
            continue;
        const bool read = fgets(line, sizeof line, file) != NULL;
        fclose(file);
        const char *end = strrchr(line, ')');
        if (read && end && strstr(line, "(helio-loader)") && sscanf(end, ") %*c %d", &of) == 1 &&
            of == parent) {
            count++;
            *last = pid;
        }
    }
    closedir(folder);
    return count;
}
