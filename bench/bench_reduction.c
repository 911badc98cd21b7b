// What does an element cost, beside the frequency step of CalculiX on the same mesh?
//
// The same part at several densities of its mesh. Ours: mesh, assembly, and reduction to seven
// averaged frames and thirty fixed-interface modes. CalculiX: reads the mesh, assembles, and
// computes the thirty lowest modes with the nodes of one frame held. Each runs alone in a process
// of its own with one thread, whose CPU time and largest memory the kernel tells. CPU time is
// judged: other work on the machine hardly changes it.
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <signal.h>
#include <unistd.h>

#include "base/json.h"
#include "bench.h"
#include "child.h"
#include "part/part.h"
#include "part/reduce.h"

enum { MODES = 30, SIZES = 3 };

static const char part_file[] = PB_CONFIG "/parts/apa300ml.json";
static const double wanted_dof[SIZES] = {2e4, 6e4, 1.5e5};

// What a process cost.
typedef struct cost {
  double wall, cpu, memory;  // s, s, bytes
} cost;

// Told by the processes through memory that they share.
typedef struct shared {
  double density, dof, factor, first_hz;
  char directory[64];
} shared;

static void load_part(double density, pb_part *part, pb_mesh *mesh) {
  cJSON *json = NULL;
  pb_error err = {0};
  bench_check(pb_json_read(part_file, &json, NULL, &err), &err);
  bench_check(pb_part_read(json, part, &err), &err);
  cJSON_Delete(json);
  part->density = density;
  bench_check(pb_part_mesh(part, mesh, &err), &err);
}

static void load_model(const shared *s, pb_part *part, pb_mesh *mesh, pb_fem *fem) {
  pb_error err = {0};
  load_part(s->density, part, mesh);
  bench_check(pb_part_model(part, mesh, fem, &err), &err);
}

static void reduce_ours(shared *s) {
  pb_part part;
  pb_mesh mesh;
  pb_fem fem;
  pb_reduction *r = NULL;
  pb_error err = {0};
  bench_blas_threads(1);
  load_model(s, &part, &mesh, &fem);
  pb_mesh_clear(&mesh);
  pb_reduce_options options = {.modes = MODES, .spend = &fem.k};
  bench_check(pb_reduce(&fem, &options, false, &r, &err), &err);
  if (!(r->rigid_residual < 1e-11))
    bench_fail("rigid motions have forces of %g", r->rigid_residual);
  s->factor = 8 * (double)r->factor_entries;
}

// Density by density until the mesh is large enough.
static void choose_density(shared *s) {
  double target = s->dof;
  for (s->density = 0.9;; s->density += 0.05) {
    pb_part part;
    pb_mesh mesh;
    load_part(s->density, &part, &mesh);
    s->dof = 3 * (double)mesh.nodes;
    pb_mesh_clear(&mesh);
    pb_part_clear(&part);
    if (s->dof >= target) return;
  }
}

static void write_elements(FILE *f, const pb_part *part, const pb_mesh *mesh) {
  for (size_t region = 0; region < part->materials; region++) {
    const pb_material *m = &part->material[region];
    fprintf(f, "*ELEMENT, TYPE=C3D20R, ELSET=E%zu\n", region);
    for (size_t e = 0; e < mesh->elements; e++) {
      if (mesh->region[e] != (int)region) continue;
      fprintf(f, "%zu", e + 1);
      for (int i = 0; i < 20; i++) fprintf(f, "%s%zu", i == 10 ? ",\n" : ",", mesh->node[e][i] + 1);
      fprintf(f, "\n");
    }
    fprintf(f, "*MATERIAL, NAME=M%zu\n*ELASTIC\n%.10g, %.10g\n*DENSITY\n%.10g\n", region,
            m->youngs_modulus, m->poisson_ratio, m->density);
    fprintf(f, "*SOLID SECTION, ELSET=E%zu, MATERIAL=M%zu\n", region, region);
  }
}

static void write_deck(shared *s) {
  pb_part part;
  pb_mesh mesh;
  pb_fem fem;
  char path[128];
  load_model(s, &part, &mesh, &fem);
  snprintf(path, sizeof path, "%s/part.inp", s->directory);
  FILE *f = fopen(path, "w");
  if (!f) bench_fail("%s cannot be written", path);
  fprintf(f, "*NODE, NSET=ALL\n");
  for (size_t i = 0; i < mesh.nodes; i++)
    fprintf(f, "%zu, %.12e, %.12e, %.12e\n", i + 1, mesh.xyz[3 * i], mesh.xyz[3 * i + 1],
            mesh.xyz[3 * i + 2]);
  write_elements(f, &part, &mesh);
  fprintf(f, "*BOUNDARY\n");
  for (size_t i = 0; i < fem.frame[0].nodes; i++)
    fprintf(f, "%zu, 1, 3\n", fem.frame[0].node[i] + 1);
  fprintf(f, "*STEP\n*FREQUENCY\n%d\n*END STEP\n", MODES);
  if (fclose(f)) bench_fail("%s cannot be written", path);
}

static void run_calculix(shared *s) {
  if (chdir(s->directory)) bench_fail("no directory %s", s->directory);
  int null = open("/dev/null", O_WRONLY);
  dup2(null, STDOUT_FILENO);
  dup2(null, STDERR_FILENO);
  setenv("OMP_NUM_THREADS", "1", 1);
  setenv("OPENBLAS_NUM_THREADS", "1", 1);
  execlp("ccx", "ccx", "-i", "part", (char *)NULL);
  _exit(127);
}

// Does the work in a process of its own.
static cost run(void (*work)(shared *), shared *s) {
  struct rusage used;
  int status;
  fflush(NULL);
  double begun = bench_now();
  pid_t pid = fork();
  if (pid < 0) bench_fail("no process could be made");
  if (pid == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    work(s);
    _exit(0);
  }
  if (wait4(pid, &status, 0, &used) != pid || !WIFEXITED(status) || WEXITSTATUS(status))
    bench_fail("a process of the measurement failed");
  return (cost){bench_now() - begun,
                (double)used.ru_utime.tv_sec + 1e-6 * (double)used.ru_utime.tv_usec +
                    (double)used.ru_stime.tv_sec + 1e-6 * (double)used.ru_stime.tv_usec,
                1024 * (double)used.ru_maxrss};
}

static void remove_files(const shared *s) {
  static const char *const ending[] = {"inp", "dat", "frd", "cvg", "sta", "eig", "12d"};
  char path[128];
  for (size_t i = 0; i < sizeof ending / sizeof *ending; i++) {
    snprintf(path, sizeof path, "%s/part.%s", s->directory, ending[i]);
    unlink(path);
  }
  snprintf(path, sizeof path, "%s/spooles.out", s->directory);
  unlink(path);
  rmdir(s->directory);
}

int main(int argc, char **argv) {
  static const bench_column columns[] = {{"dof", "degrees of freedom", NULL, 6},
                                         {"seconds", "ours, CPU", "s", 3},
                                         {"calculix_seconds", "CalculiX, CPU", "s", 3},
                                         {"ratio", "ours / CalculiX", NULL, 3},
                                         {"wall", "ours", "s", 3},
                                         {"calculix_wall", "CalculiX", "s", 3},
                                         {"memory", "ours, most memory", "MB", 4},
                                         {"calculix_memory", "CalculiX", "MB", 4},
                                         {"factor", "factor", "MB", 4}};
  bench *b = bench_begin(argc, argv, "reduction",
                         "What does an element cost, beside CalculiX' frequency step?");
  bench_table *t = bench_table_add(b, "reduction", "Reduction to 7 frames and 30 modes", "part",
                                   sizeof columns / sizeof *columns, columns);
  bool baseline = bench_program_exists("ccx");
  shared *s = mmap(NULL, sizeof *s, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (s == MAP_FAILED) bench_fail("out of memory");
  if (!baseline) bench_note(b, "CalculiX (ccx) is not installed: no comparison.");
  for (size_t i = 0; i < SIZES - (bench_quick(b) ? 1 : 0); i++) {
    *s = (shared){.dof = wanted_dof[i], .directory = "/tmp/pb-reduction-XXXXXX"};
    if (!mkdtemp(s->directory)) bench_fail("no temporary directory could be made");
    run(choose_density, s);
    cost ours = run(reduce_ours, s), theirs = {NAN, NAN, NAN};
    if (baseline) {
      run(write_deck, s);
      theirs = run(run_calculix, s);
    }
    remove_files(s);
    double ratio = ours.cpu / theirs.cpu;
    char name[64], goal[128];
    snprintf(name, sizeof name, "apa300ml, density %.2f", s->density);
    bench_row(t, name,
              (double[]){s->dof, ours.cpu, theirs.cpu, ratio, ours.wall, theirs.wall,
                         1e-6 * ours.memory, 1e-6 * theirs.memory, 1e-6 * s->factor});
    if (baseline) {
      snprintf(goal, sizeof goal, "CPU time over CalculiX' at %.0f degrees of freedom", s->dof);
      bench_goal(b, goal, ratio, BENCH_AT_MOST, 0.3);
    }
    snprintf(goal, sizeof goal, "memory at %.0f degrees of freedom", s->dof);
    bench_target(b, goal, 1e-9 * ours.memory, "GB", BENCH_AT_MOST, 2);
  }
  bench_growth(b, t, "dof", "seconds", 0);
  munmap(s, sizeof *s);
  return bench_end(b);
}
