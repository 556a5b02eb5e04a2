/* The equations of motion of sitl/vehicle in C, term by term in the order of the Python kernels, for comparison of run
   times by benchmarks/speed/physics.py. The structures have the layout of the NamedTuples of sitl/vehicle/{model,water}.py;
   arrays are pointer and count. benchmarks/speed/physics.py first checks that both have the same sizes and give the same
   states to rounding. */

#include <math.h>

typedef struct { const double *at; long count; } Array;
typedef struct { double mass; Array M_RB, M_A, M, M_inverse; } Inertia;
typedef struct { Array x, radius, drag, share, lever; double uncoupled; } Stations;
typedef struct { double X_uu, Y_uv, Y_ur, N_uv, N_ur, Z_uw, Z_uq, M_uw, M_uq, Y_uudr, N_uudr, Z_uude, M_uude, K_p, K_pp; } Hull;
typedef struct { double slope, quadratic, drag_zero_lift, induced, stall, separated, separated_normal; } Polar;
typedef struct { double x, radius, half_rho_area, vectored; Polar polar; } Duct;
typedef struct { double x, out, half_rho_area; Polar polar; Array span_y, span_z, rudder, elevator; double travel; } Fins;
typedef struct { double nn, nv, full_rps; } Propeller;
typedef struct { double weight, buoyancy, x_cm, y_cm, z_cm, x_cb, z_cb, g, half_length, radius; } Hydrostatics;
typedef struct { double far, far_nearness, steps_per_nearness; Array pull, moment; } Walls;
typedef struct { Inertia inertia; Stations stations; Hull hull; Duct duct; Fins fins; Propeller propeller; Hydrostatics hydrostatics; Walls walls; } Model;
typedef struct { double velocity[3], acceleration[3], slope[3], slope_rate[3], density_ratio, surface, surface_slope, ceiling, floor, floor_normal[3]; } Water;

const long sizes[2] = {sizeof(Model), sizeof(Water)};

static void add(double *total, double X, double Y, double Z, double K, double M, double N)
{
    total[0] += X; total[1] += Y; total[2] += Z; total[3] += K; total[4] += M; total[5] += N;
}

static void coriolis(const double *nu, const Inertia *inertia, double *f)
{
    double P[6];
    for (int i = 0; i < 6; i++) {
        P[i] = 0.0;
        for (int j = 0; j < 6; j++) P[i] += inertia->M.at[6 * i + j] * nu[j];
    }
    double u = nu[0], v = nu[1], w = nu[2], p = nu[3], q = nu[4], r = nu[5];
    add(f, r * P[1] - q * P[2], p * P[2] - r * P[0], q * P[0] - p * P[1],
        (r * P[4] - q * P[5]) + (w * P[1] - v * P[2]),
        (p * P[5] - r * P[3]) + (u * P[2] - w * P[0]),
        (q * P[3] - p * P[4]) + (v * P[0] - u * P[1]));
}

static double immersion(double z, double radius)
{
    double y = -z / radius;
    return y >= 1.0 ? 1.0 : y <= -1.0 ? 0.0 : 0.5 + (y * sqrt(1.0 - y * y) + asin(y)) / M_PI;
}

static void restoring(double z, double climb, const double *up, double ratio, const Hydrostatics *h, const Stations *s, double *f)
{
    double lost = 0.0, lost_moment = 0.0;
    if (z + fabs(climb) * h->half_length + h->radius > 0.0)
        for (long i = 0; i < s->x.count; i++) {
            double x = h->x_cb + s->lever.at[i];
            double dry = h->buoyancy * s->share.at[i] * (1.0 - immersion(z + climb * x, s->radius.at[i]));
            lost += dry;
            lost_moment += dry * x;
        }
    double buoyancy = ratio * (h->buoyancy - lost), net = buoyancy - h->weight;
    double first_x = ratio * (h->buoyancy * h->x_cb - lost_moment) - h->weight * h->x_cm;
    double first_y = -h->weight * h->y_cm;
    double first_z = buoyancy * h->z_cb - h->weight * h->z_cm;
    add(f, net * up[0], net * up[1], net * up[2], first_y * up[2] - first_z * up[1],
        first_z * up[0] - first_x * up[2], first_x * up[1] - first_y * up[0]);
}

static void crossflow(double v, double w, double q, double r, const Stations *s, double *f)
{
    double Y = 0.0, Z = 0.0, M = 0.0, N = 0.0;
    for (long i = 0; i < s->x.count; i++) {
        double x = s->x.at[i], vx = v + x * r, wx = w - x * q;
        double drag = s->drag.at[i] * sqrt(vx * vx + wx * wx);
        Y -= drag * vx; Z -= drag * wx; M += x * (drag * wx); N -= x * (drag * vx);
    }
    double e = s->uncoupled;
    if (e == 0.0) { add(f, 0.0, Y, Z, 0.0, M, N); return; }
    double drift = sqrt(v * v + w * w), rotation = sqrt(q * q + r * r), Ye = 0.0, Ze = 0.0, Me = 0.0, Ne = 0.0;
    for (long i = 0; i < s->x.count; i++) {
        double x = s->x.at[i], drag = s->drag.at[i];
        double Yx = -drag * (drift * v + fabs(x) * rotation * x * r), Zx = -drag * (drift * w - fabs(x) * rotation * x * q);
        Ye += Yx; Ze += Zx; Me -= x * Zx; Ne += x * Yx;
    }
    add(f, 0.0, (1.0 - e) * Y + e * Ye, (1.0 - e) * Z + e * Ze, 0.0, (1.0 - e) * M + e * Me, (1.0 - e) * N + e * Ne);
}

static void lift_and_drag(double u, double v, double w, double p, double q, double r, const Hull *h, double *f)
{
    double speed = fabs(u);
    add(f, -h->X_uu * u * speed, h->Y_uv * speed * v + h->Y_ur * u * r, h->Z_uw * speed * w + h->Z_uq * u * q,
        -h->K_p * p - h->K_pp * p * fabs(p), h->M_uw * u * w + h->M_uq * speed * q, h->N_uv * u * v + h->N_ur * speed * r);
}

static void coefficients(double alpha, const Polar *polar, double *lift_over_sin, double *drag)
{
    double sine = sin(alpha), lift = polar->slope * alpha + polar->quadratic * alpha * alpha;
    *lift_over_sin = sine > 1e-9 ? lift / sine : polar->slope;
    *drag = polar->drag_zero_lift + polar->induced * lift * lift;
    if (alpha <= polar->stall) return;
    double x = fmin(1.0, (alpha - polar->stall) / (polar->separated - polar->stall)), share = x * x * (3.0 - 2.0 * x);
    *lift_over_sin += share * (polar->separated_normal * cos(alpha) - *lift_over_sin);
    *drag += share * (polar->drag_zero_lift + polar->separated_normal * sine * sine - *drag);
}

static void duct_force(const double *v, const double *e, const Duct *duct, double *force)
{
    double along = v[0] * e[0] + v[1] * e[1] + v[2] * e[2];
    double cx = e[1] * v[2] - e[2] * v[1], cy = e[2] * v[0] - e[0] * v[2], cz = e[0] * v[1] - e[1] * v[0];
    double lift_over_sin, drag;
    coefficients(atan2(sqrt(cx * cx + cy * cy + cz * cz), fabs(along)), &duct->polar, &lift_over_sin, &drag);
    double lift = duct->half_rho_area * (along >= 0.0 ? lift_over_sin : -lift_over_sin);
    double resist = duct->half_rho_area * drag * sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    force[0] = lift * (v[1] * cz - v[2] * cy) - resist * v[0];
    force[1] = lift * (v[2] * cx - v[0] * cz) - resist * v[1];
    force[2] = lift * (v[0] * cy - v[1] * cx) - resist * v[2];
}

static void fins(const double *nu, double rudder, double elevator, double immersed, const Fins *fins, double *f)
{
    double u = nu[0], v = nu[1], w = nu[2], p = nu[3], q = nu[4], r = nu[5];
    for (long i = 0; i < fins->span_y.count; i++) {
        double sy = fins->span_y.at[i], sz = fins->span_z.at[i], x = fins->x, y = fins->out * sy, z = fins->out * sz;
        double turn = fmin(fmax(fins->rudder.at[i] * rudder + fins->elevator.at[i] * elevator, -fins->travel), fins->travel);
        double c = cos(turn), s = sin(turn);
        double along = u + q * z - r * y, normal = -sz * (v + r * x - p * z) + sy * (w + p * y - q * x);
        double chordwise = c * along + s * normal, across = c * normal - s * along, lift_over_sin, drag;
        coefficients(atan2(fabs(across), fabs(chordwise)), &fins->polar, &lift_over_sin, &drag);
        double lift = fins->half_rho_area * lift_over_sin * across * (chordwise >= 0.0 ? 1.0 : -1.0);
        double resist = fins->half_rho_area * drag * sqrt(chordwise * chordwise + across * across);
        double on_chord = lift * across - resist * chordwise, on_normal = -lift * chordwise - resist * across;
        double X = immersed * (c * on_chord - s * on_normal), n = immersed * (s * on_chord + c * on_normal);
        double Y = -sz * n, Z = sy * n;
        add(f, X, Y, Z, y * Z - z * Y, z * X - x * Z, x * Y - y * X);
    }
}

static void tail(const double *met, const double *e, double rudder, double elevator, double rps, double immersed, const Model *m, double *f)
{
    double x = m->duct.x, v[3] = {met[0], met[1] + x * met[5], met[2] - x * met[4]}, force[3];
    duct_force(v, e, &m->duct, force);
    double thrust = (m->propeller.nn * rps - m->propeller.nv * (v[0] * e[0] + v[1] * e[1] + v[2] * e[2])) * fabs(rps);
    double X = immersed * (force[0] + thrust * e[0]), Y = immersed * (force[1] + thrust * e[1]), Z = immersed * (force[2] + thrust * e[2]);
    add(f, X, Y, Z, 0.0, -x * Z, x * Y);
    fins(met, rudder, elevator, immersed, &m->fins, f);
}

static void contact(const double *s, const double *n, double distance, const Hydrostatics *h, double *f)
{
    double arm = h->half_length - h->radius, half = 0.5 * h->weight / h->g;
    if (distance - fabs(n[0]) * arm >= h->radius) return;
    for (double end = 1.0; end >= -1.0; end -= 2.0) {
        double x = end * arm, into = h->radius - distance - n[0] * x;
        if (into <= 0.0) continue;
        double u = s[7], v = s[8] + x * s[12], w = s[9] - x * s[11], leaving = n[0] * u + n[1] * v + n[2] * w;
        double push = half * fmax(0.0, 100.0 * into - 10.0 * leaving);
        u -= leaving * n[0]; v -= leaving * n[1]; w -= leaving * n[2];
        double rub = 0.2 * push / sqrt(u * u + v * v + w * w + 0.02 * 0.02);
        double fy = push * n[1] - rub * v, fz = push * n[2] - rub * w;
        add(f, push * n[0] - rub * u, fy, fz, 0.0, -x * fz, x * fy);
    }
}

static void pull(const double *nu, const double *n, double distance, double share, const Walls *walls, const Hydrostatics *h, double *f)
{
    if (distance >= walls->far || share == 0.0) return;
    double place = (h->radius / fmax(distance, h->radius) - walls->far_nearness) * walls->steps_per_nearness;
    long i = (long)place;
    if (i > walls->pull.count - 2) i = walls->pull.count - 2;
    double part = place - i, along = share * (1.0 - n[0] * n[0]), square = nu[0] * nu[0];
    double force = along * (walls->pull.at[i] + part * (walls->pull.at[i + 1] - walls->pull.at[i]));
    double moment = along * (walls->moment.at[i] + part * (walls->moment.at[i + 1] - walls->moment.at[i]));
    double work = moment * (n[2] * nu[4] - n[1] * nu[5]) - force * (n[0] * nu[0] + n[1] * nu[1] + n[2] * nu[2]);
    add(f, -force * square * n[0] - work * nu[0], -force * square * n[1], -force * square * n[2], 0.0,
        moment * square * n[2], -moment * square * n[1]);
}

static void boundary(const double *s, const double R[3][3], const double *nu, const Water *water, const Hydrostatics *h, const Walls *walls, double *f)
{
    double lid = fmin(water->ceiling, water->surface) - s[2], ground = (s[2] - water->floor) * water->floor_normal[2];
    if (fmin(lid, ground) > walls->far + h->half_length) return;
    double floor_[3], down[3], share = 1.0;
    for (int i = 0; i < 3; i++) {
        floor_[i] = R[0][i] * water->floor_normal[0] + R[1][i] * water->floor_normal[1] + R[2][i] * water->floor_normal[2];
        down[i] = -R[2][i];
    }
    if (water->surface <= water->ceiling) {
        double froude = fabs(nu[0]) / sqrt(h->g * fmax(lid, h->radius));
        share = fmin(1.0, fmax(0.0, (0.85 - froude) / (0.85 - 0.5))) * immersion(-lid, h->radius);
    }
    contact(s, down, water->ceiling - s[2], h, f);
    contact(s, floor_, ground, h, f);
    pull(nu, down, lid, share, walls, h, f);
    pull(nu, floor_, ground, 1.0, walls, h, f);
}

static void in_body(const double R[3][3], const double *nwu, double *body)
{
    for (int i = 0; i < 3; i++) body[i] = R[0][i] * nwu[0] + R[1][i] * nwu[1] + R[2][i] * nwu[2];
}

static void slope(const double *s, const double *e, double rudder, double elevator, double rps, const double *push, const Water *water, const Model *m, double *out)
{
    double e0 = s[3], x = s[4], y = s[5], z = s[6], p = s[10], q = s[11], r = s[12];
    const double R[3][3] = {
        {1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - e0 * z), 2.0 * (x * z + e0 * y)},
        {2.0 * (x * y + e0 * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - e0 * x)},
        {2.0 * (x * z - e0 * y), 2.0 * (y * z + e0 * x), 1.0 - 2.0 * (x * x + y * y)}};
    double c[3], a[3], along[3], spin[3], felt[3], f[6] = {0.0};
    in_body(R, water->velocity, c);
    in_body(R, water->acceleration, a);
    in_body(R, water->slope, along);
    double nu[6] = {s[7] - c[0], s[8] - c[1], s[9] - c[2], p, q, r};
    double met[6] = {nu[0], nu[1], nu[2], p, q + along[2], r - along[1]};
    const double *up = R[2];
    for (int i = 0; i < 3; i++) felt[i] = up[i] + a[i] / m->hydrostatics.g;
    double height = s[2] - water->surface, climb = up[0] - water->surface_slope;
    double immersed = immersion(height + climb * m->duct.x, m->duct.radius);
    coriolis(nu, &m->inertia, f);
    restoring(height, climb, felt, water->density_ratio, &m->hydrostatics, &m->stations, f);
    crossflow(nu[1], nu[2], met[4], met[5], &m->stations, f);
    lift_and_drag(nu[0], nu[1], nu[2], p, met[4], met[5], &m->hull, f);
    tail(met, e, rudder, elevator, rps, immersed, m, f);
    boundary(s, R, nu, water, &m->hydrostatics, &m->walls, f);
    double pressure = immersed * nu[0] * fabs(nu[0]);
    add(f, 0.0, m->hull.Y_uudr * pressure * rudder, m->hull.Z_uude * pressure * elevator, 0.0,
        m->hull.M_uude * pressure * elevator, m->hull.N_uudr * pressure * rudder);
    for (int i = 0; i < 6; i++) f[i] += push[i];

    for (int i = 0; i < 3; i++) out[i] = R[i][0] * s[7] + R[i][1] * s[8] + R[i][2] * s[9];
    out[3] = -0.5 * (x * p + y * q + z * r);
    out[4] = 0.5 * (e0 * p + y * r - z * q);
    out[5] = 0.5 * (e0 * q + z * p - x * r);
    out[6] = 0.5 * (e0 * r + x * q - y * p);
    for (int i = 0; i < 6; i++) {
        out[7 + i] = 0.0;
        for (int j = 0; j < 6; j++) out[7 + i] += m->inertia.M_inverse.at[6 * i + j] * f[j];
    }
    in_body(R, water->slope_rate, spin);
    out[7] += a[0] - (q * c[2] - r * c[1]);
    out[8] += a[1] - (r * c[0] - p * c[2]);
    out[9] += a[2] - (p * c[1] - q * c[0]);
    out[11] -= spin[2];
    out[12] += spin[1];
}

void fly(double *s, long steps, double rudder, double elevator, double rps, const double *push, const Water *water, double dt, const Model *m)
{
    double k[4][13], between[13];
    double turn = m->duct.vectored;
    for (long step = 0; step < steps; step++) {
        double e[3] = {cos(turn * rudder) * cos(turn * elevator), sin(turn * rudder), -cos(turn * rudder) * sin(turn * elevator)};
        slope(s, e, rudder, elevator, rps, push, water, m, k[0]);
        for (int stage = 1; stage < 4; stage++) {
            double h = stage < 3 ? 0.5 * dt : dt;
            for (int i = 0; i < 13; i++) between[i] = s[i] + h * k[stage - 1][i];
            slope(between, e, rudder, elevator, rps, push, water, m, k[stage]);
        }
        for (int i = 0; i < 13; i++) s[i] += dt / 6.0 * (k[0][i] + 2.0 * k[1][i] + 2.0 * k[2][i] + k[3][i]);
        double norm = sqrt(s[3] * s[3] + s[4] * s[4] + s[5] * s[5] + s[6] * s[6]);
        for (int i = 3; i < 7; i++) s[i] /= norm;
    }
}
