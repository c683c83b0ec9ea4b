/* Spheres that move with a chain against convex pieces, for a chain of JOINTS joints; see collision.py.
 *
 * chain_frames: q -> for each of FRAMES - 2 moving joints rotation (9, row by row) and position (3), in the base
 * Frame 0 is the map, frame 1 the base of the chain, the others follow in the order of the joints.
 */
#include <math.h>
#include <stddef.h>

#define AT_LEAST_ONE(n) ((n) > 0 ? (n) : 1)
#define SURE (-2)
#define UNSURE (-1)
#define ALSO_SURE (-1.0)  /* as the depth that is asked for: what is sure is asked for too */

/* Clusters, of all parts of a frame and an obstacle, have groups, of one part, which have pairs, with one piece each. */
struct bodies {
    const double *base;          /* rotation (9), position (3) of the base in the map */
    ptrdiff_t clusters;
    const int *cluster;          /* frame of the parts, obstacle */
    const int *cluster_group;    /* whose are which: cluster i has groups [i] to [i + 1] - 1 */
    const double *frame_ball;    /* for each frame centre (3) and radius of a sphere around all its parts */
    const int *obstacle_frame;
    const double *obstacle_ball;
    const int *group_part;
    const int *group_pair;
    const double *group_width;   /* the largest limit or sure gap of a group, of all groups of a cluster in the first */
    const double *part_ball;
    const int *part_sphere;
    const double *spheres;       /* centre (3), radius */
    const int *pair_piece;
    const double *limit;         /* a gap below it is a hit */
    const double *sure;          /* a gap above it is none for sure */
    const int *piece_kind;       /* how many axes count together: 1 box, 2 cylinder, 3 sphere */
    const double *piece;         /* centre (3), axes (9, columns), half extents (3), radius of a sphere around it */
    const int *part_faces;       /* the number of a part's polyhedron, negative without */
    const int *piece_faces;      /* that of a piece, or of the thing whose piece it is */
    const int *corner_first;     /* whose are which: polyhedron i has corners [i] to [i + 1] - 1 */
    const double *corners;
    const int *plane_first;
    const double *planes;        /* outward normal (3), offset */
    const double *beyond;        /* how far from a polyhedron something has to stay */
};

static void to_map(const double *frame, const double *local, double *point)
{
    for (int i = 0; i < 3; ++i)
        point[i] = frame[3 * i] * local[0] + frame[3 * i + 1] * local[1] + frame[3 * i + 2] * local[2] + frame[9 + i];
}

static void to_local(const double *frame, const double *point, double *local)
{
    double x = point[0] - frame[9], y = point[1] - frame[10], z = point[2] - frame[11];
    for (int i = 0; i < 3; ++i)
        local[i] = frame[i] * x + frame[3 + i] * y + frame[6 + i] * z;
}

/* The same for frames by number: nothing is to be done where it is the map. */
static const double *in_map(int number, const double *frame, const double *local, double *point)
{
    if (number == 0)
        return local;
    to_map(frame, local, point);
    return point;
}

static const double *seen_from(int number, const double *frame, const double *point, double *local)
{
    if (number == 0)
        return point;
    to_local(frame, point, local);
    return local;
}

static double larger(double a, double b)
{
    return a > b ? a : b;
}

/* For each row of q (rows, JOINTS) the frames of the moving joints in the base: 12 numbers each. */
void frames_rows(const double *q, ptrdiff_t rows, double *found)
{
    const double *arg[AT_LEAST_ONE(chain_frames_SZ_ARG)];
    double *res[AT_LEAST_ONE(chain_frames_SZ_RES)];
    casadi_int iw[AT_LEAST_ONE(chain_frames_SZ_IW)];
    double w[AT_LEAST_ONE(chain_frames_SZ_W)];
    for (ptrdiff_t i = 0; i < rows; ++i) {
        arg[0] = q + i * JOINTS;
        res[0] = found + i * (FRAMES - 2) * 12;
        chain_frames(arg, res, iw, w, 0);
    }
}

/* All frames, with the base of the chain at `base`; or `only` one of them, which is there itself, and the map. */
static void place(const double *q, const double *base, int only, double frames[FRAMES][12])
{
    double found[FRAMES * 12];
    for (int i = 0; i < 12; ++i) {
        frames[0][i] = i == 0 || i == 4 || i == 8;
        frames[only > 0 ? only : 1][i] = base[i];
    }
    if (only > 0)
        return;
    frames_rows(q, 1, found);
    for (int f = 2; f < FRAMES; ++f) {
        const double *here = found + (f - 2) * 12;
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                frames[f][3 * i + j] =
                    base[3 * i] * here[j] + base[3 * i + 1] * here[3 + j] + base[3 * i + 2] * here[6 + j];
        to_map(base, here + 9, frames[f] + 9);
    }
}

/* Distance of a point of a piece's frame from the piece, negative inside. */
static double distance(const double *piece, int kind, const double *point)
{
    double away[3], x = point[0] - piece[0], y = point[1] - piece[1], z = point[2] - piece[2];
    for (int i = 0; i < 3; ++i)
        away[i] = fabs(piece[3 + i] * x + piece[6 + i] * y + piece[9 + i] * z);
    if (kind >= 2) {
        away[0] = sqrt(away[0] * away[0] + away[1] * away[1]);
        away[1] = 0.0;
    }
    if (kind == 3) {
        away[0] = sqrt(away[0] * away[0] + away[2] * away[2]);
        away[2] = 0.0;
    }
    double out = 0.0, most = -INFINITY;
    for (int i = 0; i < 3; ++i) {
        double past = away[i] - piece[12 + i];
        most = larger(most, past);
        past = larger(past, 0.0);
        out += past * past;
    }
    return sqrt(out) - larger(-most, 0.0);
}

static double square(const double *a, const double *b)
{
    double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
}

static int apart(const double *a, const double *b, double distance)
{
    return distance < 0.0 || square(a, b) > distance * distance;
}

/* The smallest gap between spheres at points of the map and a piece, or any that is larger than `far`; any that is
 * smaller than `enough` is as good. */
static double gap(const double (*points)[3], const double *spheres, int count, const double *piece, int kind,
                  int number, const double *frame, const double *centre, double far, double enough)
{
    double least = INFINITY, local[3];
    for (int k = 0; k < count && least >= enough; ++k) {
        double radius = spheres[4 * k + 3];
        if (far < INFINITY && apart(points[k], centre, piece[15] + radius + far))
            continue;
        if (kind == 3) {
            least = fmin(least, sqrt(square(points[k], centre)) - piece[12] - radius);
        } else {
            least = fmin(least, distance(piece, kind, seen_from(number, frame, points[k], local)) - radius);
        }
    }
    return least;
}

/* Whether a plane of one polyhedron has all corners of another, which is in another frame, far enough beyond it. */
static int beyond_plane(const struct bodies *all, int one, const double *here, int other, const double *there)
{
    double away = all->beyond[one] + all->beyond[other], turn[9], shift[3];
    const double *corners = all->corners + 3 * all->corner_first[other];
    int count = all->corner_first[other + 1] - all->corner_first[other], near = 0;
    for (int i = 0; i < 3; ++i)  /* the other's frame as the one sees it */
        for (int j = 0; j < 3; ++j)
            turn[3 * i + j] = here[i] * there[j] + here[3 + i] * there[3 + j] + here[6 + i] * there[6 + j];
    to_local(here, there + 9, shift);
    for (int p = all->plane_first[one]; p < all->plane_first[one + 1]; ++p) {
        const double *n = all->planes + 4 * p;
        double x = turn[0] * n[0] + turn[3] * n[1] + turn[6] * n[2];
        double y = turn[1] * n[0] + turn[4] * n[1] + turn[7] * n[2];
        double z = turn[2] * n[0] + turn[5] * n[1] + turn[8] * n[2];
        double offset = n[3] + away - n[0] * shift[0] - n[1] * shift[1] - n[2] * shift[2];
        int c = 0;
        if (x * corners[3 * near] + y * corners[3 * near + 1] + z * corners[3 * near + 2] <= offset)
            continue;  /* that corner is not beyond this plane either */
        while (c < count && x * corners[3 * c] + y * corners[3 * c + 1] + z * corners[3 * c + 2] > offset)
            ++c;
        if (c == count)
            return 1;
        near = c;
    }
    return 0;
}

/* Whether two are polyhedra, with a plane of one of them between the two. */
static int planes_between(const struct bodies *all, int one, const double *mine, int two, const double *other)
{
    return one >= 0 && two >= 0 &&
           (beyond_plane(all, one, mine, two, other) || beyond_plane(all, two, other, one, mine));
}

/* The first hit, else SURE or UNSURE; with `gaps` all of them are told, with `doubtful` the pairs that are not sure.
 * Where spheres have to be `deeper` inside than the limits say, nothing is said to be sure. With `only` above 0 just
 * what moves with that frame is looked at, against what is in the map. */
static int judged(const double *q, const double *base, int only, const struct bodies *all, double deeper, double *gaps,
                  int *doubtful)
{
    double frames[FRAMES][12], balls[FRAMES][3], points[SPHERES][3], middle[3], placed_ball[3], placed_piece[3], local[3];
    int state = deeper >= 0.0 ? UNSURE : SURE, found = 0;
    double less = fmax(deeper, 0.0);
    place(q, base, only, frames);
    for (int f = only > 0 ? only : 1; f < (only > 0 ? only + 1 : FRAMES); ++f)
        to_map(frames[f], all->frame_ball + 4 * f, balls[f]);
    for (ptrdiff_t c = 0; c < all->clusters; ++c) {
        int mine = all->cluster[2 * c], obstacle = all->cluster[2 * c + 1], first = all->cluster_group[c];
        int theirs = all->obstacle_frame[obstacle];
        if (only > 0 && (mine != only || theirs != 0))
            continue;
        const double *other = frames[theirs], *ball = all->obstacle_ball + 4 * obstacle;
        const double *around = in_map(theirs, other, ball, placed_ball);
        if (!gaps && apart(balls[mine], around, all->frame_ball[4 * mine + 3] + ball[3] + all->group_width[2 * first]))
            continue;
        for (int g = first; g < all->cluster_group[c + 1]; ++g) {
            int part = all->group_part[g], from = all->part_sphere[part], count = all->part_sphere[part + 1] - from;
            const double *part_ball = all->part_ball + 4 * part, *spheres = all->spheres + 4 * from;
            int placed = 0, looked_at = -1, between = 0;
            to_map(frames[mine], part_ball, middle);
            if (!gaps && apart(middle, around, part_ball[3] + ball[3] + all->group_width[2 * g + 1]))
                continue;
            for (int p = all->group_pair[g]; p < all->group_pair[g + 1]; ++p) {
                int number = all->pair_piece[p];
                const double *piece = all->piece + 16 * number;
                double limit = all->limit[p] - less, far = state == SURE || doubtful ? fmax(limit, all->sure[p]) : limit;
                const double *centre = in_map(theirs, other, piece, placed_piece);
                if (!gaps && apart(middle, centre, part_ball[3] + piece[15] + far))
                    continue;
                if (!gaps && all->piece_kind[number] < 3) {  /* a wall or a floor: its sphere says nothing */
                    const double *seen = seen_from(theirs, other, middle, local);
                    if (distance(piece, all->piece_kind[number], seen) > part_ball[3] + far)
                        continue;
                }
                for (; placed < count; ++placed)
                    to_map(frames[mine], spheres + 4 * placed, points[placed]);
                if (gaps) {
                    gaps[p] = gap(points, spheres, count, piece, all->piece_kind[number], theirs, other, centre,
                                  INFINITY, -INFINITY);
                    continue;
                }
                double least =
                    gap(points, spheres, count, piece, all->piece_kind[number], theirs, other, centre, far, limit);
                if (least < limit && !doubtful)
                    return p;
                if (least > (doubtful ? far : all->sure[p]) || (state != SURE && !doubtful))
                    continue;
                if (all->piece_faces[number] != looked_at) {  /* the pieces of one polyhedron follow each other */
                    looked_at = all->piece_faces[number];
                    between = planes_between(all, all->part_faces[part], frames[mine], looked_at, other);
                }
                if (between && looked_at >= 0)
                    continue;
                if (doubtful)
                    doubtful[found++] = p;
                state = UNSURE;
            }
        }
    }
    return doubtful ? found : state;
}

/* For each row of q (rows, JOINTS): SURE that nothing is hit, UNSURE, or the number of a pair that is. */
void judge_rows(const double *q, ptrdiff_t rows, const struct bodies *all, int *found)
{
    for (ptrdiff_t i = 0; i < rows; ++i)
        found[i] = judged(q + i * JOINTS, all->base, 0, all, ALSO_SURE, NULL, NULL);
}

/* For each row of q (rows, JOINTS) and of bases (rows, 12) the first pair that is hit by so much more, else UNSURE. */
void hit_rows(const double *q, const double *bases, ptrdiff_t rows, double deeper, const struct bodies *all, int *found)
{
    for (ptrdiff_t i = 0; i < rows; ++i)
        found[i] = judged(q + i * JOINTS, bases + i * 12, 0, all, deeper, NULL, NULL);
}

/* For each place (rows, 12) of a frame in the map the first pair that what moves with it hits there, else UNSURE. */
void frame_hit_rows(int frame, const double *places, ptrdiff_t rows, const struct bodies *all, int *found)
{
    for (ptrdiff_t i = 0; i < rows; ++i)
        found[i] = judged(NULL, places + i * 12, frame, all, 0.0, NULL, NULL);
}

/* The first pair that is hit at points order[0 .. inner) of an edge in `pieces` pieces, else UNSURE. */
int edge_hit(const double *from, const double *to, ptrdiff_t pieces, const int *order, ptrdiff_t inner,
             const struct bodies *all)
{
    double q[JOINTS];
    for (ptrdiff_t i = 0; i < inner; ++i) {
        double share = (double)order[i] / (double)pieces;
        for (int j = 0; j < JOINTS; ++j)
            q[j] = from[j] + (to[j] - from[j]) * share;
        int one = judged(q, all->base, 0, all, 0.0, NULL, NULL);
        if (one >= 0)
            return one;
    }
    return UNSURE;
}

/* The smallest gap of every pair. */
void gaps_at(const double *q, const struct bodies *all, double *gaps)
{
    judged(q, all->base, 0, all, ALSO_SURE, gaps, NULL);
}

/* Numbers of the pairs that are hit or not free for sure; how many they are. */
int doubtful_at(const double *q, const struct bodies *all, int *pairs)
{
    return judged(q, all->base, 0, all, ALSO_SURE, NULL, pairs);
}
