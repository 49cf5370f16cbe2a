/* The impact clock followed contact by contact, as one would write it in C: the rival of the kernel's method `events`.
 * Units, frames and contacts as in kernels/impact/_half_swing.py, with a flat lever; no derivatives.
 * gcc -O3 -march=native -shared -fPIC -o impact_events.so impact_events.c -lm */
#include <math.h>
#include <stdbool.h>

typedef struct { double wheel, pallet, eta, e; } Scene;
typedef struct { double time, way, travel, loss, rim, speed, behind, recoil, margin, held; long impacts, events; } Tally;

static double meets(double gap, double closing, double pull) {
    double square = closing * closing + 2.0 * pull * gap;
    if (square < 0.0) return INFINITY;
    if (closing > 0.0) return 2.0 * gap / (closing + sqrt(square));
    return pull > 0.0 ? (sqrt(square) - closing) / pull : INFINITY;
}

static double reduced(double gap) {
    gap -= ceil(gap - 4e-16);
    return gap < 0.0 ? gap : 0.0;
}

static double fence(double gap) { return gap > 0.0 ? 0.0 : gap < -1.0 ? -1.0 : gap; }

static void count(Tally *t, double V, double dt) {
    double way = (V + 0.5 * dt) * dt;
    if (V < 0.0) t->recoil = fmax(t->recoil, t->behind + (V + dt > 0.0 ? 0.5 * V * V : -way));
    t->behind = fmax(t->behind - way, 0.0);
    t->way += way;
    t->time += dt;
    t->events++;
}

static double joint(Tally *t, double wheel, double W, double dt, double way) { /* lowest way */
    double low = 0.0;
    if (W < 0.0) {
        double turn = fmin(-W, wheel * dt);
        low = (W + 0.5 * turn) * turn / wheel;
        t->recoil = fmax(t->recoil, t->behind - low);
    }
    t->behind = fmax(t->behind - way, 0.0);
    t->way += way;
    t->time += dt;
    t->events++;
    return low;
}

static double lowest(double wheel, double away, double W, double t) {
    double turn = fmin(-W / wheel, t);
    return turn > 0.0 ? away + (W + 0.5 * wheel * turn) * turn : away;
}

/* one half swing from (gap, V, w); 0 where its events do not end */
static bool half_swing(const Scene *s, double z[3], Tally *tally) {
    const double wheel = s->wheel, pallet = s->pallet, eta = s->eta, e = s->e;
    double gap = z[0], V = z[1], w = z[2], y = -eta, far = 0.0, dip = y;
    bool near = false, struck = false;
    for (int i = 0; i < 20000; i++) {
        double f = fence(gap), rate = V - w, t = meets(-f, rate, 1.0), line = INFINITY;
        bool behind = false, across = false;
        if (rate < 0.0) {
            double back = meets(1.0 + f, -rate, -1.0);
            if (back < t) t = back, behind = true;
        }
        if (near) {
            double b = fence(far), r = V + w, u = meets(-b, r, 1.0);
            bool under = false;
            if (r < 0.0) {
                double back = meets(1.0 + b, -r, -1.0);
                if (back < u) u = back, under = true;
            }
            if (u < t) t = u, behind = under, across = true;
        }
        if (w > 0.0) line = fmax(((near ? eta : -eta) - y) / w, 0.0);
        else if (near && w < 0.0) line = fmax((-eta - y) / w, 0.0);
        bool contact = t < line;
        if (!contact) t = line;
        if (!(t < INFINITY)) return false;
        count(tally, V, t);
        gap += (V - w + 0.5 * t) * t;
        far += (V + w + 0.5 * t) * t;
        y += w * t;
        V += t;
        if (!contact) {
            if (near && w > 0.0) {
                tally->margin = fmin(tally->margin, fmin(fabs(gap), fabs(1.0 + gap)));
                z[0] = reduced(far), z[1] = V, z[2] = -w;
                tally->travel -= dip;
                return true;
            }
            y = -eta;
            far = reduced(gap + 2.0 * y - 0.5);
            tally->margin = fmin(tally->margin, fmin(fabs(far), fabs(1.0 + far)));
            near = w > 0.0;
            continue;
        }
        double side = across ? -1.0 : 1.0, closing = V - side * w, push = (1.0 + e) * closing;
        V -= pallet * push;
        w += side * wheel * push;
        tally->loss += 0.5 * (1.0 - e) * (1.0 + e) * closing * closing * pallet;
        tally->impacts++;
        dip = fmin(dip, y);
        if (across) far = behind ? -1.0 : 0.0;
        else gap = behind ? -1.0 : 0.0;
        if (behind) continue;
        if (!across && !struck) struck = true, tally->rim += V, tally->speed += w;

        double away = side * y, W = wheel * V + pallet * side * w, bounce = fmax(side * w - V, 0.0);
        double span = 2.0 * bounce / (1.0 - e), speed = W + wheel * span, widest = 0.5 * bounce * bounce;
        double end = away + 0.5 * (W + speed) * span;
        double low = lowest(wheel, away, W, span), high = fmax(end, away) + wheel * widest;
        bool clear = widest <= 0.5 - 2.0 * eta || low > -0.25 + 0.5 * widest || high < -eta;
        bool plain = W >= 0.0 ? V >= 0.0 : speed <= 0.0 && speed * speed >= 2.0 * wheel * pallet * widest;
        if (!(high < eta && clear && plain && (side > 0.0 || low > -eta))) continue;
        double deep = side * (away + joint(tally, wheel, W, span, end - away));
        dip = fmin(dip, deep);
        tally->loss += pallet * widest;

        double goal = eta, lift;
        bool ends = side > 0.0;
        if (side < 0.0 && lowest(wheel, end, speed, INFINITY) <= -eta) {
            goal = -eta, ends = true;
            lift = -sqrt(fmax(speed * speed - 2.0 * wheel * (end + eta), 0.0));
        } else lift = sqrt(speed * speed + 2.0 * wheel * (eta - end));
        t = goal < eta || ends == (side < 0.0) ? (lift - speed) / wheel : meets(eta - end, speed, wheel);
        deep = side * (end + joint(tally, wheel, speed, t, goal - end));
        dip = fmin(dip, deep);
        tally->held += t;
        V = lift, w = side * lift, y = side * goal;
        double other = reduced(2.0 * eta - 0.5);
        if (ends) {
            z[0] = across ? 0.0 : other, z[1] = V, z[2] = -w;
            tally->travel -= dip;
            return true;
        }
        gap = other, near = false;
    }
    return false;
}

/* n clocks for so many half swings; `starts` is changed to where they end, `out` has 12 numbers for each */
void follow(long n, const double *scenes, double *starts, long half_swings, double *out) {
    for (long i = 0; i < n; i++) {
        const Scene *scene = (const Scene *)(scenes + 4 * i);
        Tally t = {.margin = INFINITY};
        for (long j = 0; j < half_swings; j++)
            if (!half_swing(scene, starts + 3 * i, &t)) break;
        double *o = out + 12 * i;
        o[0] = t.time, o[1] = t.way, o[2] = t.travel, o[3] = t.loss, o[4] = t.rim, o[5] = t.speed;
        o[6] = t.recoil, o[7] = t.margin, o[8] = t.held, o[9] = t.impacts, o[10] = t.events, o[11] = t.behind;
    }
}
