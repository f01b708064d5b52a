"""The text of an exported C header; ``export.c_header`` fills it.

NAME stands for the beginning of all names, and braces for sizes, weights and the lines of a step.
"""

__all__ = ["TEMPLATE"]

TEMPLATE = """\
/* {title}

{about}

   NAME_state state = {{0}};                        once per epoch
   NAME_step(&state, observations, outputs);    once per iteration

   An output is any real number; NAME_sigmoid(output) lies between 0 and 1. Compile with
   -ffp-contract=off: then the results are those of the simulator, bit for bit. */
#ifndef CONEVO_NAME_H
#define CONEVO_NAME_H
#include <float.h>
#if FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 16
#error "floats must be rounded to float: on 32-bit x86 compile with -msse2 -mfpmath=sse"
#endif
#ifdef __FAST_MATH__
#error "compile without -ffast-math: the order of additions matters"
#endif
#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

enum {{ NAME_robots = {r}, NAME_sensors = {s}, NAME_outputs = {o} }};

/* The memory of the robots; zeros at the start of an epoch. */
typedef struct {{
    float context[{r}][{room}];
}} NAME_state;

{weights}

/* The logistic function by a rational approximation, error below 1e-6. */
static inline float NAME_sigmoid(float a) {{
    float h = a * 0.5f;
    h = h < -{limit} ? -{limit} : h > {limit} ? {limit} : h;
    float q = h * h;
    float p = {numerator};
    float d = {denominator};
    return 0.5f + 0.5f * ((h * p) / d);
}}

/* From observations [{r}][{s}] to outputs [{r}][{o}], row by row; the state moves on. */
static inline void NAME_step(NAME_state *state, const float *observations, float *outputs) {{
    for (int r = 0; r < {r}; r++, observations += {s}, outputs += {o}) {{
{lines}
    }}
}}

#endif
"""
