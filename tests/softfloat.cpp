// Loops over arrays of operands around Berkeley SoftFloat 3e, whose functions come from softfloatpy's extension module.
// IEEE results only: bringing them to Lightloom's contract is the caller's work (tests/softfloat.py).
#include <cstddef>
#include <cstdint>

extern "C" {
struct float16_t { uint16_t v; };
struct float32_t { uint32_t v; };
struct float64_t { uint64_t v; };
struct float128_t { uint64_t v[2]; };  // least significant word first

extern uint_fast8_t softfloat_roundingMode, softfloat_exceptionFlags;
enum { near_even = 0, towards_zero = 1, down = 2, inexact = 1, invalid = 16 };

float32_t f32_add(float32_t, float32_t), f32_sub(float32_t, float32_t), f32_mul(float32_t, float32_t);
float32_t f32_div(float32_t, float32_t), f32_sqrt(float32_t), f16_to_f32(float16_t), f64_to_f32(float64_t);
float32_t f128_to_f32(float128_t);
bool f32_eq(float32_t, float32_t), f32_lt_quiet(float32_t, float32_t);
float16_t f32_to_f16(float32_t);
float64_t f32_to_f64(float32_t), i32_to_f64(int32_t), f64_mul(float64_t, float64_t);
float32_t i64_to_f32(int64_t);
int_fast32_t f64_to_i32(float64_t, uint_fast8_t mode, bool exact);
float128_t f32_to_f128(float32_t), f128_mul(float128_t, float128_t), f128_sub(float128_t, float128_t);

typedef const uint32_t *In;

void float_add(size_t n, In a, In b, In subtract, uint32_t *z) {
    for (size_t k = 0; k < n; k++)
        z[k] = subtract[k] ? f32_sub({a[k]}, {b[k]}).v : f32_add({a[k]}, {b[k]}).v;
}

void float_multiply(size_t n, In a, In b, uint32_t *z) {
    for (size_t k = 0; k < n; k++) z[k] = f32_mul({a[k]}, {b[k]}).v;
}

void float_divide(size_t n, In a, In b, uint32_t *z) {
    for (size_t k = 0; k < n; k++) z[k] = f32_div({a[k]}, {b[k]}).v;
}

void float_sqrt(size_t n, In a, uint32_t *z) {
    for (size_t k = 0; k < n; k++) z[k] = f32_sqrt({a[k]}).v;
}

// The products are exact in binary128; their difference is rounded to odd there, then once to binary32.
void float_difference_of_products(size_t n, In a, In b, In c, In d, uint32_t *z) {
    for (size_t k = 0; k < n; k++) {
        float128_t p = f128_mul(f32_to_f128({a[k]}), f32_to_f128({b[k]}));
        float128_t q = f128_mul(f32_to_f128({c[k]}), f32_to_f128({d[k]}));
        softfloat_roundingMode = towards_zero;
        softfloat_exceptionFlags = 0;
        float128_t difference = f128_sub(p, q);
        if (softfloat_exceptionFlags & inexact) difference.v[0] |= 1;
        softfloat_roundingMode = near_even;
        z[k] = f128_to_f32(difference).v;
    }
}

// Bits 0 to 3: less, equal, greater, unordered.
void float_compare(size_t n, In a, In b, uint32_t *z) {
    for (size_t k = 0; k < n; k++) {
        bool less = f32_lt_quiet({a[k]}, {b[k]}), greater = f32_lt_quiet({b[k]}, {a[k]}), equal = f32_eq({a[k]}, {b[k]});
        z[k] = less | equal << 1 | greater << 2 | !(less | equal | greater) << 3;
    }
}

// SoftFloat has no minimum: its comparisons choose, and the sign decides between equal numbers, which are zeros or same.
void float_minmax(size_t n, In a, In b, In maximum, uint32_t *z) {
    for (size_t k = 0; k < n; k++) {
        bool nan_a = !f32_eq({a[k]}, {a[k]}), nan_b = !f32_eq({b[k]}, {b[k]});
        bool less = f32_eq({a[k]}, {b[k]}) ? a[k] >> 31 : f32_lt_quiet({a[k]}, {b[k]});
        z[k] = nan_a ? b[k] : nan_b ? a[k] : less != bool(maximum[k]) ? a[k] : b[k];
    }
}

void float_to_half(size_t n, In a, uint32_t *z) {
    for (size_t k = 0; k < n; k++) z[k] = f32_to_f16({a[k]}).v;
}

void half_to_float(size_t n, In a, uint32_t *z) {
    for (size_t k = 0; k < n; k++) z[k] = f16_to_f32({uint16_t(a[k])}).v;
}

// Scaling by a power of two is exact in binary64. Out of range: the nearest integer there is, and 0 for a NaN.
static void to_fixed(size_t n, In a, In fraction, uint32_t *z, uint_fast8_t mode) {
    for (size_t k = 0; k < n; k++) {
        softfloat_exceptionFlags = 0;
        bool nan = !f32_eq({a[k]}, {a[k]});
        float64_t scaled = f64_mul(f32_to_f64({a[k]}), {uint64_t(1023 + fraction[k]) << 52});
        softfloat_exceptionFlags = 0;
        z[k] = f64_to_i32(scaled, mode, false);
        if (softfloat_exceptionFlags & invalid) z[k] = nan ? 0 : a[k] >> 31 ? 0x80000000 : 0x7FFFFFFF;
    }
}

void float_to_fixed(size_t n, In a, In fraction, uint32_t *z) { to_fixed(n, a, fraction, z, near_even); }

void float_to_fixed_down(size_t n, In a, In fraction, uint32_t *z) { to_fixed(n, a, fraction, z, down); }

void fixed_to_float(size_t n, In a, In fraction, uint32_t *z) {
    for (size_t k = 0; k < n; k++)
        z[k] = f64_to_f32(f64_mul(i32_to_f64(int32_t(a[k])), {uint64_t(1023 - fraction[k]) << 52})).v;
}

// The one rounding is SoftFloat's; what it gives is far from the least normal number.
void fixed64_to_float(size_t n, const int64_t *a, In fraction, uint32_t *z) {
    for (size_t k = 0; k < n; k++) z[k] = f32_mul(i64_to_f32(a[k]), {(127 - fraction[k]) << 23}).v;
}
}
