/* The value of one input at which the model comes to a wanted output, by bisection between turning points of the map. */
typedef struct {
    const real *in; /* the other inputs; and where to look near */
    int which;      /* the input that is looked for */
    real wanted;
} problem;

typedef real (*function)(const problem *, real);

/* What is missing to the wanted output at a value of the input. */
static real missing_at(const problem *p, real x)
{
    real in[INPUTS], out;
    for (int i = 0; i < INPUTS; i++) in[i] = i == p->which ? x : p->in[i];
    EVALUATE(in, &out);
    return out - p->wanted;
}

static real derivative_at(const problem *p, real x)
{
    real in[INPUTS], out, slopes[INPUTS];
    for (int i = 0; i < INPUTS; i++) in[i] = i == p->which ? x : p->in[i];
    DIFFERENTIATE(in, &out, slopes);
    return slopes[p->which];
}

/* Where a function changes its sign between two values. */
static real bisected(function f, const problem *p, real low, real high)
{
    const real start = sign_of(f(p, low));
    for (int i = 0; i < BISECTIONS; i++) {
        const real middle = (low + high) / 2;
        if (sign_of(f(p, middle)) == start)
            low = middle;
        else
            high = middle;
    }
    return (low + high) / 2;
}

/* Ends of the monotone parts, ascending, and what is missing there: each interval between knots is looked at in equal parts. */
static int scanned(const problem *p, int count, const real *knots, int parts, real *edges, real *missing)
{
    int n = 0;
    for (int i = 0; i < count - 1; i++) {
        const real step = (knots[i + 1] - knots[i]) / (real)parts;
        for (int j = 0; j < parts; j++) {
            const real start = (real)j * step + knots[i];
            const real end = j < parts - 1 ? (real)(j + 1) * step + knots[i] : knots[i + 1];
            const real low = NEXT(start, INFINITY), high = NEXT(end, -INFINITY);
            edges[n++] = start;
            if (sign_of(derivative_at(p, low)) * sign_of(derivative_at(p, high)) < 0) edges[n++] = bisected(derivative_at, p, low, high);
        }
    }
    edges[n++] = knots[count - 1];
    for (int i = 0; i < n; i++) missing[i] = missing_at(p, edges[i]);
    return n;
}

/* How near to the wanted output counts as equal: a share of the span of outputs; negative where one is not finite. */
static real equal_within(const problem *p, int n, const real *missing)
{
    real low = INFINITY, high = -INFINITY;
    for (int i = 0; i < n; i++) {
        if (!isfinite(missing[i])) return -1;
        low = FMIN(low, missing[i]);
        high = FMAX(high, missing[i]);
    }
    return SAME * FMAX(high - low, FABS(p->wanted));
}

/* One more solution: the first counts, or the one that is nearest to where to look. */
static void found_one(const problem *p, real x, int *count, real *picked)
{
    const real near = p->in[p->which];
    if (*count == 0 || FABS(x - near) < FABS(*picked - near)) *picked = x;
    ++*count;
}

static int solved(const problem *p, int count, const real *knots, int parts, real *found)
{
    real edges[PLACES], missing[PLACES];
    const int n = scanned(p, count, knots, parts, edges, missing);
    const real within = equal_within(p, n, missing);
    int solutions = 0, flat = 0, before = 0;
    *found = NAN;
    if (within < 0 || !isfinite(p->wanted)) return NONE;
    for (int i = 0; i < n; i++) {
        const int hit = FABS(missing[i]) <= within;
        if (i > 0 && hit && before && edges[i] > edges[i - 1]) flat = 1;
        if (i > 0 && !hit && !before && sign_of(missing[i - 1]) * sign_of(missing[i]) < 0 && edges[i] > edges[i - 1]) {
            const real x = bisected(missing_at, p, edges[i - 1], edges[i]);
            /* where the map jumps across the wanted output, there is no solution */
            if (FABS(missing_at(p, x)) <= FMAX(REACHED * FABS(p->wanted), within)) found_one(p, x, &solutions, found);
        }
        if (hit && !before) found_one(p, edges[i], &solutions, found);
        before = hit;
    }
    return flat ? FLAT : solutions > 1 ? SEVERAL : solutions;
}
