typedef struct { double *at; int rows; } vector;

typedef struct { double *at; int rows, columns; } matrix;

static double min2(double a, double b) { return b < a ? b : a; }

static double max2(double a, double b) { return b > a ? b : a; }

static int imin(int a, int b) { return b < a ? b : a; }

static int imax(int a, int b) { return b > a ? b : a; }

static double square(double a) { return a * a; }

static double cube(double a) { return a * (a * a); }

static double fmodulo(double a, double b)
{
    const double r = fmod(a, b);
    return r == 0.0 ? copysign(0.0, b) : (r < 0.0) != (b < 0.0) ? r + b : r;
}

static int modulo(int a, int n)
{
    return a % n != 0 && (a < 0) != (n < 0) ? a % n + n : a % n;
}

static int quotient(int a, int n)
{
    return a % n != 0 && (a < 0) != (n < 0) ? a / n - 1 : a / n;
}

static int whole(double a)
{
    return a >= 1e9 ? 1000000000 : a > -1e9 ? (int)a : -1000000000;
}

static vector part(vector a, int from, int to)
{
    vector r = {a.at + from, to - from};
    return r;
}

static vector row_of(matrix a, int i)
{
    vector r = {a.at + i * a.columns, a.columns};
    return r;
}

static matrix band(matrix a, int from, int to)
{
    matrix r = {a.at + from * a.columns, to - from, a.columns};
    return r;
}

static matrix shaped(vector a, int rows, int columns)
{
    matrix r = {a.at, rows, columns};
    return r;
}
