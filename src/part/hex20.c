// The 20-node hexahedron: see hex20.h.
#include "part/hex20.h"

#include <math.h>
#include <string.h>

static const double corner[20][3] = {
    {-1, -1, -1}, {1, -1, -1}, {1, 1, -1},  {-1, 1, -1}, {-1, -1, 1}, {1, -1, 1}, {1, 1, 1},
    {-1, 1, 1},   {0, -1, -1}, {1, 0, -1},  {0, 1, -1},  {-1, 0, -1}, {0, -1, 1}, {1, 0, 1},
    {0, 1, 1},    {-1, 0, 1},  {-1, -1, 0}, {1, -1, 0},  {1, 1, 0},   {-1, 1, 0}};

const int pb_hex20_face[6][8] = {{0, 3, 2, 1, 11, 10, 9, 8},   {4, 5, 6, 7, 12, 13, 14, 15},
                                 {0, 1, 5, 4, 8, 17, 12, 16},  {1, 2, 6, 5, 9, 18, 13, 17},
                                 {2, 3, 7, 6, 10, 19, 14, 18}, {3, 0, 4, 7, 11, 16, 15, 19}};

static void shape_corner(const double at[3], const double c[3], double *n, double dn[3]) {
  double f[3], sum = -2;
  for (int a = 0; a < 3; a++) f[a] = 1 + at[a] * c[a], sum += at[a] * c[a];
  *n = 0.125 * f[0] * f[1] * f[2] * sum;
  for (int a = 0; a < 3; a++) dn[a] = 0.125 * c[a] * f[(a + 1) % 3] * f[(a + 2) % 3] * (sum + f[a]);
}

static void shape_side(const double at[3], const double c[3], double *n, double dn[3]) {
  double f[3], df[3];
  for (int a = 0; a < 3; a++) {
    f[a] = c[a] == 0 ? 1 - at[a] * at[a] : 1 + at[a] * c[a];
    df[a] = c[a] == 0 ? -2 * at[a] : c[a];
  }
  *n = 0.25 * f[0] * f[1] * f[2];
  for (int a = 0; a < 3; a++) dn[a] = 0.25 * df[a] * f[(a + 1) % 3] * f[(a + 2) % 3];
}

void pb_hex20_shape(const double local[3], double n[20], double dn[20][3]) {
  for (int i = 0; i < 20; i++) {
    if (i < 8) {
      shape_corner(local, corner[i], n + i, dn[i]);
    } else {
      shape_side(local, corner[i], n + i, dn[i]);
    }
  }
}

// Derivatives in space from those in local coordinates; returns the Jacobian determinant.
static double to_space(double xyz[20][3], double dn[20][3], double grad[20][3]) {
  double j[3][3] = {{0}}, inverse[3][3];
  for (int i = 0; i < 20; i++)
    for (int a = 0; a < 3; a++)
      for (int b = 0; b < 3; b++) j[a][b] += dn[i][a] * xyz[i][b];
  for (int a = 0; a < 3; a++)
    for (int b = 0; b < 3; b++)
      inverse[b][a] = j[(a + 1) % 3][(b + 1) % 3] * j[(a + 2) % 3][(b + 2) % 3] -
                      j[(a + 1) % 3][(b + 2) % 3] * j[(a + 2) % 3][(b + 1) % 3];
  double det = j[0][0] * inverse[0][0] + j[0][1] * inverse[1][0] + j[0][2] * inverse[2][0];
  if (!grad || det == 0) return det;
  for (int i = 0; i < 20; i++)
    for (int b = 0; b < 3; b++)
      grad[i][b] =
          (inverse[b][0] * dn[i][0] + inverse[b][1] * dn[i][1] + inverse[b][2] * dn[i][2]) / det;
  return det;
}

// The eight integration points (corners scaled by `reach`).
static double det_at(double xyz[20][3], int point, double reach, double n[20], double grad[20][3]) {
  double local[3], dn[20][3];
  for (int a = 0; a < 3; a++) local[a] = reach * corner[point][a];
  pb_hex20_shape(local, n, dn);
  return to_space(xyz, dn, grad);
}

double pb_hex20_jacobian(double xyz[20][3]) {
  double worst = INFINITY, n[20];
  for (int point = 0; point < 8; point++) {
    worst = fmin(worst, det_at(xyz, point, 1, n, NULL));
    worst = fmin(worst, det_at(xyz, point, sqrt(1.0 / 3), n, NULL));
  }
  return worst;
}

double pb_hex20_volume(double xyz[20][3]) {
  double volume = 0, n[20];
  for (int point = 0; point < 8; point++) volume += det_at(xyz, point, sqrt(1.0 / 3), n, NULL);
  return volume;
}

static void add_point(double det, double n[20], double g[20][3], const pb_material *material,
                      double (*k)[20][3][3], double (*m)[20]) {
  double e = material->youngs_modulus, nu = material->poisson_ratio;
  double lambda = det * e * nu / ((1 + nu) * (1 - 2 * nu)), mu = det * e / (2 * (1 + nu));
  for (int i = 0; i < 20; i++) {
    for (int j = i; j < 20; j++) {
      double dot = mu * (g[i][0] * g[j][0] + g[i][1] * g[j][1] + g[i][2] * g[j][2]);
      for (int a = 0; a < 3; a++) {
        for (int b = 0; b < 3; b++)
          k[i][j][a][b] += lambda * g[i][a] * g[j][b] + mu * g[i][b] * g[j][a];
        k[i][j][a][a] += dot;
      }
      m[i][j] += det * material->density * n[i] * n[j];
    }
  }
}

bool pb_hex20_matrices(double xyz[20][3], const pb_material *material, double (*k)[20][3][3],
                       double (*m)[20]) {
  memset(k, 0, 20 * sizeof *k);
  memset(m, 0, 20 * sizeof *m);
  for (int point = 0; point < 8; point++) {
    double n[20], grad[20][3];
    double det = det_at(xyz, point, sqrt(1.0 / 3), n, grad);
    if (!(det > 0)) return false;
    add_point(det, n, grad, material, k, m);
  }
  return true;
}

// The 8-node quadrilateral: the hexahedron's face ζ = −1 says the same with ξ, η.
static void shape_face(double s, double t, double n[8], double dn[8][2]) {
  static const double at[8][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1},
                                  {0, -1},  {1, 0},  {0, 1}, {-1, 0}};
  for (int i = 0; i < 8; i++) {
    double x = at[i][0], y = at[i][1], f = 1 + s * x, g = 1 + t * y;
    if (i < 4) {
      n[i] = 0.25 * f * g * (s * x + t * y - 1);
      dn[i][0] = 0.25 * x * g * (2 * s * x + t * y);
      dn[i][1] = 0.25 * y * f * (s * x + 2 * t * y);
    } else if (x == 0) {
      n[i] = 0.5 * (1 - s * s) * g;
      dn[i][0] = -s * g;
      dn[i][1] = 0.5 * (1 - s * s) * y;
    } else {
      n[i] = 0.5 * (1 - t * t) * f;
      dn[i][0] = 0.5 * (1 - t * t) * x;
      dn[i][1] = -t * f;
    }
  }
}

double pb_face8_moments(double xyz[8][3], const double origin[3], double weight[8][4]) {
  static const double w[3] = {5.0 / 9, 8.0 / 9, 5.0 / 9};
  double point[3] = {-sqrt(0.6), 0, sqrt(0.6)}, area = 0;
  memset(weight, 0, 8 * sizeof *weight);
  for (int p = 0; p < 9; p++) {
    double n[8], dn[8][2], tangent[2][3] = {{0}}, at[3], normal[3];
    shape_face(point[p % 3], point[p / 3], n, dn);
    for (int a = 0; a < 3; a++) {
      at[a] = -origin[a];
      for (int i = 0; i < 8; i++) {
        at[a] += n[i] * xyz[i][a];
        for (int b = 0; b < 2; b++) tangent[b][a] += dn[i][b] * xyz[i][a];
      }
    }
    for (int a = 0; a < 3; a++)
      normal[a] = tangent[0][(a + 1) % 3] * tangent[1][(a + 2) % 3] -
                  tangent[0][(a + 2) % 3] * tangent[1][(a + 1) % 3];
    double da = w[p % 3] * w[p / 3] *
                sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    area += da;
    for (int i = 0; i < 8; i++) {
      weight[i][0] += n[i] * da;
      for (int a = 0; a < 3; a++) weight[i][1 + a] += n[i] * at[a] * da;
    }
  }
  return area;
}
