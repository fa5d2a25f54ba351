// Two compiled kernels of ccfem in C++, for benchmarks/speed/native.py: the assembly of linear cells
// (ccfem/fem/elasticity/assembly.py) and solves with stored supernodes (direct.py).
#include <cstdint>
#include <vector>

extern "C" void gradients(const double *points, const int64_t *cells, int64_t count,
                          double *result, double *volume) {
    for (int64_t cell = 0; cell < count; cell++) {
        const int64_t *corner = cells + 4 * cell;
        double e[3][3], *g = result + 12 * cell, determinant = 0.0;
        for (int a = 0; a < 3; a++)
            for (int d = 0; d < 3; d++)
                e[a][d] = points[3 * corner[a + 1] + d] - points[3 * corner[0] + d];
        for (int a = 0; a < 3; a++)
            for (int d = 0; d < 3; d++) {
                int b = (a + 1) % 3, c = (a + 2) % 3, p = (d + 1) % 3, q = (d + 2) % 3;
                g[3 * (a + 1) + d] = e[b][p] * e[c][q] - e[b][q] * e[c][p];
            }
        for (int d = 0; d < 3; d++) determinant += e[0][d] * g[3 + d];
        volume[cell] = determinant / 6.0;
        for (int d = 0; d < 3; d++) {
            double total = 0.0;
            for (int a = 1; a < 4; a++) total += (g[3 * a + d] /= determinant);
            g[d] = -total;
        }
    }
}

extern "C" void gather_linear(const int32_t *indptr, const int32_t *indices, const int32_t *start,
                              const int32_t *touching, int64_t rows, const int64_t *cells,
                              const double *gradients, const double *scale, const double *c,
                              double *data) {
    std::vector<int32_t> slot(rows), diagonal(rows);
    double t[6][3];
    for (int64_t i = 0; i < rows; i++) {
        for (int32_t s = indptr[i]; s < indptr[i + 1]; s++) slot[indices[s]] = s;
        for (int32_t e = start[i]; e < start[i + 1]; e++) {
            int64_t cell = touching[e] / 4;
            const double *g = gradients + 12 * cell, *own = g + 3 * (touching[e] % 4);
            double x = scale[cell] * own[0], y = scale[cell] * own[1], z = scale[cell] * own[2];
            for (int k = 0; k < 6; k++) {
                t[k][0] = c[6 * k] * x + c[6 * k + 4] * z + c[6 * k + 5] * y;
                t[k][1] = c[6 * k + 1] * y + c[6 * k + 3] * z + c[6 * k + 5] * x;
                t[k][2] = c[6 * k + 2] * z + c[6 * k + 3] * y + c[6 * k + 4] * x;
            }
            for (int b = 0; b < 4; b++) {
                int64_t j = cells[4 * cell + b];
                if (j < i) continue;
                const double *q = g + 3 * b;
                double *block = data + 9 * static_cast<int64_t>(slot[j]);
                for (int p = 0; p < 3; p++) {
                    block[3 * p] += t[0][p] * q[0] + t[4][p] * q[2] + t[5][p] * q[1];
                    block[3 * p + 1] += t[1][p] * q[1] + t[3][p] * q[2] + t[5][p] * q[0];
                    block[3 * p + 2] += t[2][p] * q[2] + t[3][p] * q[1] + t[4][p] * q[0];
                }
            }
        }
        for (int32_t s = indptr[i]; s < indptr[i + 1]; s++) {
            if (indices[s] == i) {
                diagonal[i] = s;
                break;
            }
            const double *above = data + 9 * static_cast<int64_t>(++diagonal[indices[s]]);
            double *block = data + 9 * static_cast<int64_t>(s);
            for (int p = 0; p < 3; p++)
                for (int r = 0; r < 3; r++) block[3 * p + r] = above[3 * r + p];
        }
    }
}

extern "C" void substitute_blocks(const int64_t *first, const int64_t *starts,
                                  const int64_t *row_starts, const float *values,
                                  const int32_t *rows, const double *pivots, int64_t count,
                                  int64_t n, double *x) {
    std::vector<double> room(n);
    double *total = room.data();
    for (int64_t s = 0; s < count; s++) {
        double *own = x + first[s];
        int64_t wide = first[s + 1] - first[s], size = row_starts[s + 1] - row_starts[s], c = 0;
        const int64_t high = wide + size;
        const int32_t *below = rows + row_starts[s];
        const float *block = values + starts[s];
        for (int64_t k = 0; k < wide - 1; k++)
            for (int64_t i = k + 1; i < wide; i++) own[i] -= block[k * high + i] * own[k];
        for (int64_t i = 0; i < size; i++) total[i] = 0.0;
        for (; c + 4 <= wide; c += 4) {
            const float *a = block + c * high + wide, *b = a + high, *d = b + high, *e = d + high;
            double p = own[c], q = own[c + 1], r = own[c + 2], t = own[c + 3];
            for (int64_t i = 0; i < size; i++)
                total[i] += a[i] * p + b[i] * q + d[i] * r + e[i] * t;
        }
        for (; c < wide; c++)
            for (int64_t i = 0; i < size; i++) total[i] += block[c * high + wide + i] * own[c];
        for (int64_t i = 0; i < size; i++) x[below[i]] -= total[i];
    }
    for (int64_t i = 0; i < n; i++) x[i] /= pivots[i];
    for (int64_t s = count - 1; s >= 0; s--) {
        double *own = x + first[s];
        int64_t wide = first[s + 1] - first[s], size = row_starts[s + 1] - row_starts[s], c = 0;
        const int64_t high = wide + size;
        const int32_t *below = rows + row_starts[s];
        const float *block = values + starts[s];
        for (int64_t i = 0; i < size; i++) total[i] = x[below[i]];
        for (; c + 4 <= wide; c += 4) {
            const float *a = block + c * high + wide, *b = a + high, *d = b + high, *e = d + high;
            double p = 0.0, q = 0.0, r = 0.0, t = 0.0;
            for (int64_t i = 0; i < size; i++) {
                p += a[i] * total[i];
                q += b[i] * total[i];
                r += d[i] * total[i];
                t += e[i] * total[i];
            }
            own[c] -= p, own[c + 1] -= q, own[c + 2] -= r, own[c + 3] -= t;
        }
        for (; c < wide; c++)
            for (int64_t i = 0; i < size; i++) own[c] -= block[c * high + wide + i] * total[i];
        for (int64_t k = wide - 2; k >= 0; k--)
            for (int64_t i = k + 1; i < wide; i++) own[k] -= block[k * high + i] * own[i];
    }
}
