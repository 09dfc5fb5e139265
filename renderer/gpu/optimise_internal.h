// optimise_internal.h - what the parts of the optimiser share: the module as it is read, values,
// instructions and blocks as they will be written. Ids are those of the module; all other numbers
// are places in lists, where 0 is nothing.
#ifndef HG_RENDERER_GPU_OPTIMISE_INTERNAL_H
#define HG_RENDERER_GPU_OPTIMISE_INTERNAL_H

#define SPV_ENABLE_UTILITY_CODE
#include <spirv/unified1/spirv.h>

#include "renderer/gpu/spirv.h"

enum {
    OPT_MOST_LEAVES = 256,  // of a variable that becomes values
    OPT_MOST_NEW = 1 << 12, // constants that are added
};

struct opt_type {
    uint32_t op;
    uint32_t leaves; // scalars, vectors and matrices it is made of; 0: it is kept whole
    uint32_t element,
        count; // vectors, matrices, arrays; pointers: what they point to, storage class
    const uint32_t *members; // of structures
    uint32_t undef, null;    // values of this type, once they are asked for
};

struct opt_id {
    const uint32_t *def; // its instruction in the module
    uint32_t value;      // that it has by now
    uint32_t root;       // pointers: the local variable or parameter that they point into
    uint32_t number;     // of a constant that is known
    uint32_t block, end; // of a label: its block here, and where that block ends
    uint32_t function;   // place in the list of functions + 1
    bool known, decorated;
    bool memory; // a root that stays in memory
    bool kept;   // a call that is not expanded; a parameter of a function that is written
};

struct opt_function {
    uint32_t id;
    const uint32_t *begin, *entry, *end; // OpFunction, its first label, OpFunctionEnd
    uint32_t stores, store_count;
    uint32_t block_count, return_count;
    bool deep;     // returns from within a loop or switch
    bool straight; // returns at its end alone
    bool analysed, queued, written;
};

struct opt_store { // or what may store: a pointer that is given to a function
    const uint32_t *at;
    uint32_t root;
};

enum opt_value_kind { VALUE_NONE, VALUE_GLOBAL, VALUE_RESULT, VALUE_TUPLE, VALUE_PLACE };

struct opt_value {
    uint32_t kind, type;
    uint32_t at;      // id, instruction, first of its children, or place
    uint32_t forward; // the value that has taken its place
};

// Where a pointer into a variable that has become values points.
struct opt_place {
    uint32_t leaf, leaf_count;
    uint32_t inner[2], inner_count; // values: into a matrix or vector
};

struct opt_leaf {
    uint32_t type, variable; // variable: its first leaf
    uint32_t writes;         // the last of them
};

struct opt_write {
    uint32_t order, before;
};

enum opt_operand_kind { OPERAND_WORD, OPERAND_VALUE, OPERAND_BLOCK };

struct opt_operand {
    uint32_t word, kind;
};

struct opt_instruction {
    uint32_t op, type, source; // source: id in the module, whose decorations it has, or 0
    uint32_t value;            // its result, or 0
    uint32_t first, count;     // operands
    uint32_t block, next;
    uint32_t id;    // as it is written
    bool removable; // when nothing asks for its result
    bool live;
};

struct opt_block {
    uint32_t order; // in which it is written; 0: not yet
    uint32_t idom;  // immediate dominator
    uint32_t first, last, phis;
    uint32_t edges, edge_count; // to blocks before
    uint32_t loop;              // of a header
    uint32_t continues;         // of a continue block: the header
    uint32_t id;
    bool declared; // where a construct ends or goes on
    bool heads;    // a construct begins at its end
};

struct opt_edge {
    uint32_t from, next;
};

struct opt_loop {
    uint32_t before;                   // the block that enters it
    uint32_t modified, modified_count; // variables that are written in it, sorted
    uint32_t last;                     // order of its last block, once it is closed
    uint32_t waiting, is_closed;       // phis without operands
};

enum opt_list {
    LIST_VALUES,
    LIST_INSTRUCTIONS,
    LIST_OPERANDS,
    LIST_BLOCKS,
    LIST_EDGES,
    LIST_CHILDREN, // values
    LIST_PLACES,
    LIST_LEAVES,
    LIST_WRITES,
    LIST_LOOPS,
    LIST_MODIFIED, // first leaves of variables
    LIST_STORES,
    LIST_ADDED,   // words: constants
    LIST_ORDER,   // blocks
    LIST_LOCALS,  // instructions: variables in memory of the function that is written
    LIST_WAITING, // phi, leaf, the one before
    LIST_RETURNS, // block, first leaf of the value among the children, the one before
    LIST_WORK,    // instructions
    LIST_CLONES,  // id in the module, id as it is written
    LIST_OUT,     // words
    LIST_COUNT
};

struct opt_table { // open addressing
    uint64_t *keys;
    uint32_t *values;
    size_t count, capacity;
};

struct opt {
    const uint32_t *words;
    size_t count, first_function;
    uint32_t bound, next_id, last_id; // next_id: of constants that are added
    struct opt_id *ids;
    struct opt_type *types; // by id
    struct opt_function *functions;
    uint32_t function_count;
    struct {
        void *items;
        size_t count, capacity;
    } lists[LIST_COUNT];
    struct opt_table defs, known; // (leaf, block) to values; pure instructions by what they are
    uint32_t current;             // block that is written to, or 0: no way leads here
    uint32_t first_order;         // of the function that is written
    uint32_t extended;            // id of the import of GLSL.std.450
    uint32_t int_type;            // of 32 bits, or 0
    uint32_t depth;               // calls within calls
    uint32_t unused;              // stands for what there is no memory for
    bool failed;                  // something that is not known here
};

// --- lists (optimise.c) ---
// Room for `count` zeroed elements at the end: the place of the first, or 0 when there is no
// memory.
uint32_t opt_add(struct opt *o, enum opt_list list, uint32_t count);
static inline size_t opt_count(const struct opt *o, enum opt_list list)
{
    return o->lists[list].count;
}
#define OPT_ACCESS(type, name, list)                                                               \
    static inline type *name(const struct opt *o, uint32_t at)                                     \
    {                                                                                              \
        return &((type *)o->lists[list].items)[at];                                                \
    }
OPT_ACCESS(struct opt_value, opt_value_at, LIST_VALUES)
OPT_ACCESS(struct opt_instruction, opt_instruction_at, LIST_INSTRUCTIONS)
OPT_ACCESS(struct opt_operand, opt_operand_at, LIST_OPERANDS)
OPT_ACCESS(struct opt_block, opt_block_at, LIST_BLOCKS)
OPT_ACCESS(struct opt_edge, opt_edge_at, LIST_EDGES)
OPT_ACCESS(uint32_t, opt_child_at, LIST_CHILDREN)
OPT_ACCESS(struct opt_place, opt_place_at, LIST_PLACES)
OPT_ACCESS(struct opt_leaf, opt_leaf_at, LIST_LEAVES)
OPT_ACCESS(struct opt_write, opt_write_at, LIST_WRITES)
OPT_ACCESS(struct opt_loop, opt_loop_at, LIST_LOOPS)
OPT_ACCESS(uint32_t, opt_modified_at, LIST_MODIFIED)
OPT_ACCESS(struct opt_store, opt_store_at, LIST_STORES)
OPT_ACCESS(uint32_t, opt_word_at, LIST_ADDED)
OPT_ACCESS(uint32_t, opt_order_at, LIST_ORDER)
OPT_ACCESS(uint32_t, opt_local_at, LIST_LOCALS)
OPT_ACCESS(uint32_t, opt_waiting_at, LIST_WAITING)
OPT_ACCESS(uint32_t, opt_return_at, LIST_RETURNS)
OPT_ACCESS(uint32_t, opt_work_at, LIST_WORK)
OPT_ACCESS(uint32_t, opt_clone_at, LIST_CLONES)
OPT_ACCESS(uint32_t, opt_out_at, LIST_OUT)
// The value of a key that is not 0, to read or write; NULL: no memory.
uint32_t *opt_find(struct opt *o, struct opt_table *table, uint64_t key);
uint32_t opt_look(const struct opt_table *table, uint64_t key); // or 0
// An id below the bound; another one fails, and is that of nothing.
struct opt_id *opt_id(struct opt *o, uint32_t id);
struct opt_type *opt_type(struct opt *o, uint32_t id);

// --- the module (optimise_module.c) ---
// Types, constants and functions, and what becomes of the variables of the latter.
void opt_read_module(struct opt *o);
// Operands of an instruction: which are literals, and whether it may be left out or shared.
struct opt_shape {
    bool known, removable, pure;
    uint32_t literal, literal_count; // place after type and result
};
struct opt_shape opt_shape_of(const struct opt *o, const uint32_t *i);
// The type of a part of a composite, or 0.
uint32_t opt_part_type(struct opt *o, uint32_t type, uint32_t part);
uint32_t opt_part_count(struct opt *o, uint32_t type);
// A truth value, or an integer of 32 bits: what can be folded.
bool opt_is_short(struct opt *o, uint32_t type);
static inline uint32_t opt_slots(struct opt *o, uint32_t type)
{
    const uint32_t leaves = opt_type(o, type)->leaves;
    return leaves ? leaves : 1;
}

// --- values (optimise_values.c) ---
uint32_t opt_resolve(const struct opt *o, uint32_t value);
uint32_t opt_type_of(const struct opt *o, uint32_t value);
uint32_t opt_global(struct opt *o, uint32_t id);
uint32_t opt_undef(struct opt *o, uint32_t type);
uint32_t opt_number(struct opt *o, uint32_t type, uint32_t number);
bool opt_is_known(const struct opt *o, uint32_t value, uint32_t *number);
uint32_t opt_tuple(struct opt *o, uint32_t type, const uint32_t *parts, uint32_t count);
// Part of a composite.
uint32_t opt_part(struct opt *o, uint32_t value, uint32_t part);
// The same value as the result of an instruction or a constant.
uint32_t opt_whole(struct opt *o, uint32_t value);
// The same value with another type of the same shape.
uint32_t opt_retype(struct opt *o, uint32_t value, uint32_t type);
// Its leaves in order; room for opt_slots of its type. And back.
uint32_t opt_flatten(struct opt *o, uint32_t value, uint32_t *leaves);
uint32_t opt_unflatten(struct opt *o, uint32_t type, const uint32_t *leaves, uint32_t *at);
// The value of an operation, if it is known without computing it; else 0.
uint32_t opt_fold(
    struct opt *o, uint32_t op, uint32_t type, const uint32_t *values, uint32_t count);
// An instruction at the end of the current block: begun, given operands, and finished. Between
// these nothing else may be written. Finished, it is its result, or one that is the same.
uint32_t opt_begin(struct opt *o, uint32_t op, uint32_t type, uint32_t source);
void opt_operand(struct opt *o, enum opt_operand_kind kind, uint32_t word);
uint32_t opt_finish(struct opt *o, uint32_t instruction, bool removable, bool pure);
bool opt_dominates(const struct opt *o, uint32_t a, uint32_t b);

// --- blocks and local variables (optimise_locals.c) ---
uint32_t opt_block_new(struct opt *o);
void opt_edge(struct opt *o, uint32_t from, uint32_t to);
// The block is written to from now on.
void opt_enter(struct opt *o, uint32_t block);
uint32_t opt_variable(struct opt *o, uint32_t type);
uint32_t opt_leaf_read(struct opt *o, uint32_t leaf, uint32_t block);
void opt_leaf_write(struct opt *o, uint32_t leaf, uint32_t value);
// What a place holds, and what it holds from now on.
uint32_t opt_place_read(struct opt *o, uint32_t place, uint32_t type);
void opt_place_write(struct opt *o, uint32_t place, uint32_t value);
uint32_t opt_phi(struct opt *o, uint32_t block, uint32_t type);
// Its operands: one for each edge, in their order, with room made by opt_phi_room.
uint32_t opt_phi_room(struct opt *o, uint32_t phi);
void opt_phi_close(struct opt *o, uint32_t phi);
void opt_loop_open(struct opt *o, uint32_t header);
void opt_loop_close(struct opt *o, uint32_t header);

// A value that is a place.
uint32_t opt_place(struct opt *o, const struct opt_place *place, uint32_t type);

// --- functions (optimise_walk.c) ---
// Writes a function with all that it calls, for opt_put_function.
void opt_write_function(struct opt *o, struct opt_function *f);

// --- out (optimise_write.c) ---
void opt_put_function(struct opt *o, const struct opt_function *f);
bool opt_put_module(struct opt *o, struct hg_spirv *out);

#endif
