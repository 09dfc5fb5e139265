// folder.h - a folder of its own for a test, below $TMPDIR, or /tmp where that is none or too long.
#ifndef HG_TESTS_SUPPORT_FOLDER_H
#define HG_TESTS_SUPPORT_FOLDER_H

#include <stdbool.h>
#include <stddef.h>

// Bytes of a name with its end; leaves a unix socket in the folder room in its 108.
#define TEST_FOLDER_MAX 64

// An empty folder named after `purpose`. False, with a line on stderr: it cannot be made there.
bool test_folder_make(char path[TEST_FOLDER_MAX], const char *purpose);
// Removes the folder and all in it, links as links; true when it is gone. "" counts as gone.
bool test_folder_remove(const char *path);

// Write a file, or end the test.
void test_file_write(const char *path, const void *data, size_t size);
void test_text_write(const char *folder, const char *name, const char *text);

#endif
