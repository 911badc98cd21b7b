// A drawing as an SVG file, or as a PNG file by gnuplot.
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "build_picture.h"
#include "outfile.h"
#include "plot_gnuplot.h"

enum { WIDTH = 1200, MARGIN = 40 };

// From metres to points: scale, and where the left and lower edges lie.
typedef struct frame {
  double scale, left, low;
  int height;
} frame;

static frame frame_of(const drawing *d) {
  double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
  for (size_t i = 0; i < d->polygons; i++) {
    for (int k = 0; k < 8; k++) {
      low[0] = fmin(low[0], d->polygon[i].x[k]), high[0] = fmax(high[0], d->polygon[i].x[k]);
      low[1] = fmin(low[1], d->polygon[i].y[k]), high[1] = fmax(high[1], d->polygon[i].y[k]);
    }
  }
  frame f = {.left = low[0], .low = low[1]};
  f.scale = fmin((WIDTH - 2 * MARGIN) / (high[0] - low[0]), 1100 / (high[1] - low[1]));
  f.left -= 0.5 * ((WIDTH - 2 * MARGIN) / f.scale - (high[0] - low[0]));
  f.height = (int)ceil(f.scale * (high[1] - low[1])) + 3 * MARGIN;
  return f;
}

static double across(const frame *f, double x) {
  return MARGIN + f->scale * (x - f->left);
}
static double above(const frame *f, double y) {
  return MARGIN + f->scale * (y - f->low);
}

// A name is anybody's text: as such in XML, and in a string of gnuplot, which a line ends.
static void put_xml(FILE *out, const char *text) {
  for (; *text; text++) {
    unsigned char c = (unsigned char)*text;
    if (strchr("<>&\"'", c))
      fprintf(out, "&#%d;", c);
    else
      fputc(c < 0x20 ? ' ' : c, out);
  }
}

static void put_quoted(FILE *out, const char *text) {
  fputc('\'', out);
  for (; *text; text++) {
    if (*text == '\'') fputc('\'', out);
    fputc((unsigned char)*text < 0x20 ? ' ' : *text, out);
  }
  fputc('\'', out);
}

pb_status drawing_svg(const drawing *d, const char *path, pb_error *err) {
  pb_outfile file;
  frame f = frame_of(d);
  pb_status st = pb_outfile_open(path, &file, err);
  if (st) return st;
  FILE *out = file.stream;
  fprintf(out,
          "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\">\n"
          "<rect width=\"100%%\" height=\"100%%\" fill=\"white\"/>\n"
          "<text x=\"%d\" y=\"%d\" font-family=\"sans-serif\" font-size=\"18\">",
          WIDTH, f.height, MARGIN, MARGIN);
  put_xml(out, d->title);
  fprintf(out, "</text>\n<g stroke=\"#303030\" stroke-width=\"0.6\" stroke-linejoin=\"round\">\n");
  for (size_t i = 0; i < d->polygons; i++) {
    const polygon *p = d->polygon + i;
    fprintf(out, "<polygon fill=\"#%02x%02x%02x\" points=\"", p->rgb[0], p->rgb[1], p->rgb[2]);
    for (int k = 0; k < 8; k++)
      fprintf(out, "%.1f,%.1f ", across(&f, p->x[k]), f.height - above(&f, p->y[k]));
    fprintf(out, "\"/>\n");
  }
  fprintf(out, "</g>\n</svg>\n");
  return pb_outfile_close(&file, err);
}

pb_status drawing_png(const drawing *d, const char *path, pb_error *err) {
  frame f = frame_of(d);
  FILE *script = tmpfile();
  if (!script) return pb_fail(err, PB_ERR_IO, path, "no temporary file: %s", strerror(errno));
  fprintf(script,
          "set terminal pngcairo size %d,%d noenhanced font 'DejaVu Sans,12' background '#ffffff'\n"
          "unset key\nunset border\nunset tics\nset margins 0,0,0,0\n"
          "set xrange [0:%d]\nset yrange [0:%d]\nset label 1 ",
          WIDTH, f.height, WIDTH, f.height);
  put_quoted(script, d->title);
  fprintf(script, " at screen 0.03, screen 0.97\n");
  for (size_t i = 0; i < d->polygons; i++) {
    const polygon *p = d->polygon + i;
    fprintf(script, "set object %zu polygon from ", i + 1);
    for (int k = 0; k <= 8; k++)
      fprintf(script, "%s%.2f,%.2f", k ? " to " : "", across(&f, p->x[k % 8]),
              above(&f, p->y[k % 8]));
    fprintf(script, " fillcolor rgb '#%02x%02x%02x' fillstyle solid border rgb '#303030' lw 0.6\n",
            p->rgb[0], p->rgb[1], p->rgb[2]);
  }
  fprintf(script, "plot NaN notitle\n");
  pb_status st = ferror(script) ? pb_fail(err, PB_ERR_IO, path, "the script cannot be written")
                                : pb_gnuplot_run(script, path, err);
  fclose(script);
  return st;
}
