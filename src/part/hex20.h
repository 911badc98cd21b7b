// The 20-node hexahedron with 2 × 2 × 2 integration points, and the 8-node faces it shows outside.
//
// Node order of Abaqus and CalculiX (C3D20R): corners 1–4 of the face ζ = −1 anticlockwise seen
// from ζ = +1, 5–8 those of ζ = +1, then the mid-side nodes 9–12 of the first face (12 23 34 41),
// 13–16 of the second (56 67 78 85), 17–20 between them (15 26 37 48).
//
//   N_i = ⅛ (1+ξξ_i)(1+ηη_i)(1+ζζ_i)(ξξ_i+ηη_i+ζζ_i−2)          corners
//   N_i = ¼ (1−ξ²)(1+ηη_i)(1+ζζ_i)                               mid-side nodes with ξ_i = 0, …
//   K_ij = ∫ λ ∇N_i ∇N_jᵀ + μ (∇N_j ∇N_iᵀ + ∇N_i·∇N_j I) dV,    M_ij = ∫ ρ N_i N_j dV ⊗ I
//
// Source: O. C. Zienkiewicz, R. L. Taylor, The Finite Element Method, serendipity elements.
#ifndef PB_PART_HEX20_H
#define PB_PART_HEX20_H

#include <stdbool.h>
#include <stddef.h>

typedef struct pb_material {
  double youngs_modulus;  // Pa
  double poisson_ratio;
  double density;  // kg/m³
} pb_material;

// N [20] and its derivatives dn [20][3] by (ξ, η, ζ). [any]
void pb_hex20_shape(const double local[3], double n[20], double dn[20][3]);

// Smallest Jacobian determinant over the corners and integration points, m³ (an eighth of the
// volume for a cube); ≤ 0: the element is turned inside out somewhere. xyz [20][3], m. [any]
double pb_hex20_jacobian(double xyz[20][3]);

// Volume by the integration points, m³. [any]
double pb_hex20_volume(double xyz[20][3]);

// k [20][20][3][3]: blocks of K, N/m; m [20][20]: scalar M, kg. Blocks with j ≥ i are filled.
// false: the Jacobian is not positive at an integration point. [any]
bool pb_hex20_matrices(double xyz[20][3], const pb_material *material, double (*k)[20][3][3],
                       double (*m)[20]);

// Nodes of face 0…5 (four corners in turn, then the mid-side nodes 12 23 34 41). [any]
extern const int pb_hex20_face[6][8];

// Consistent weights of an 8-node face: weight[i][0…3] = ∫ N_i (1, x, y, z) dA, x from `origin`;
// 3 × 3 points. xyz [8][3]. Returns the area, m². [any]
double pb_face8_moments(double xyz[8][3], const double origin[3], double weight[8][4]);

#endif
