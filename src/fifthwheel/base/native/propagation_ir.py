"""LLVM assembly of the product of the Jacobians of a step and directions, sample by sample."""

from collections.abc import Sequence


def propagation(sizes: Sequence[int], n: int, m: int, lanes: int) -> str:
    """LLVM assembly of `propagate`, for a step with `sizes` as in `adjoint.AdjointScan`.

        void propagate(i64 samples, i64 directions, ptr adjoint, ptr output, ptr slopes, ptr first, ptr column,
                       ptr value, ptr output')

    adjoint (samples, n + n_p, groups, lanes), in single precision; output (samples, n_output), of which the last 3 m
    are read; slopes (directions, groups, lanes), the derivatives [x', d'], updated in place; first, column and value
    are the elements of p' that are not zero; output' (samples, m, directions). For each sample and direction

        [x+', e'] = J [x', p'] - [0, a d'],    d+' = b d' + c e',

    where a lane of x has a = b = 0 and c = 1.
    """
    groups, outputs, adjoint = -(-(n + m) // lanes), sizes[6], sizes[8]
    vector, single, width = f"<{lanes} x double>", f"<{lanes} x float>", groups * lanes
    lines: list[str] = []
    count = 0

    def emit(text: str) -> str:
        nonlocal count
        count += 1
        lines.append(f"  %v{count} = {text}")
        return f"%v{count}"

    def load(kind: str, base: str, number: int | str) -> str:
        pointer = emit(f"getelementptr {kind}, ptr {base}, i64 {number}")
        return emit(f"load {kind}, ptr {pointer}, align {4 if kind == single else 8}")

    def spread(scalar: str) -> str:
        first = emit(f"insertelement {vector} poison, double {scalar}, i64 0")
        return emit(f"shufflevector {vector} {first}, {vector} poison, <{lanes} x i32> zeroinitializer")

    def add(total: str, a: str, b: str, how: str = "fadd") -> str:
        return emit(f"{how} contract {vector} {total}, {emit(f'fmul contract {vector} {a}, {b}')}")

    def literal(values: Sequence[float]) -> str:
        return "<" + ", ".join(f"double {value:.1f}" for value in values) + ">"

    def take() -> str:
        text, lines[:] = "\n".join(lines), []
        return text

    def element(base: str, number: int | str) -> str:
        return emit(f"fpext {single} {load(single, base, number)} to {vector}")

    jacobian = [[element("%J", i * groups + g) for g in range(groups)] for i in range(n)]
    in_state = [[float(g * lanes + lane < n) for lane in range(lanes)] for g in range(groups)]
    feedback = [
        [literal([0.0] * lanes) for _ in range(groups)],
        [literal([0.0] * lanes) for _ in range(groups)],
        [literal(state) for state in in_state],
    ]
    for number, vectors in enumerate(feedback):
        for i in range(m):
            g, lane = divmod(n + i, lanes)
            value = load("double", "%row.output", outputs - 3 * m + number * m + i)
            vectors[g] = emit(f"insertelement {vector} {vectors[g]}, double {value}, i64 {lane}")
    of_row = take()
    before = [load(vector, "%S", g) for g in range(groups)]
    totals = [literal([0.0] * lanes)] * groups
    for i in range(n):
        slope = spread(load("double", "%S", i))
        totals = [add(total, jacobian[i][g], slope) for g, total in enumerate(totals)]
    begin = emit("load i64, ptr %first.here, align 8")
    end = load("i64", "%first.here", 1)
    of_direction = take()
    place = emit(f"mul i64 {load('i64', '%column', '%j')}, {groups}")
    base = emit(f"getelementptr {single}, ptr %J, i64 {place}")
    slope = spread(load("double", "%value", "%j"))
    sums = [add(f"%sum.{g}", element(base, g), slope) for g in range(groups)]
    of_element = take()
    a, b, c = feedback
    results = [add(f"%total.{g}", a[g], before[g], "fsub") for g in range(groups)]
    for g in range(groups):
        later = add(emit(f"fmul contract {vector} {c[g]}, {results[g]}"), b[g], before[g])
        pointer = emit(f"getelementptr {vector}, ptr %S, i64 {g}")
        lines.append(f"  store {vector} {later}, ptr {pointer}, align 8")
    for i in range(m):
        g, lane = divmod(n + i, lanes)
        value = emit(f"extractelement {vector} {results[g]}, i64 {lane}")
        at = emit(f"add i64 %k, {emit(f'mul i64 %directions, {i}')}")
        pointer = emit(f"getelementptr double, ptr %row.slope, i64 {at}")
        lines.append(f"  store double {value}, ptr {pointer}, align 8")
    of_result = take()
    sum_phis = "\n".join(
        f"  %sum.{g} = phi {vector} [{totals[g]}, %direction], [{sums[g]}, %element]" for g in range(groups)
    )
    total_phis = "\n".join(
        f"  %total.{g} = phi {vector} [{totals[g]}, %direction], [{sums[g]}, %element]" for g in range(groups)
    )
    return f"""
define void @propagate(i64 %samples, i64 %directions, ptr noalias %adjoint, ptr noalias %output, ptr noalias %slopes,
                       ptr noalias %first, ptr noalias %column, ptr noalias %value, ptr noalias %slope) {{
entry:
  %pitch = mul i64 %directions, {m}
  br label %row
row:
  %t = phi i64 [0, %entry], [%t.next, %row.end]
  %J.at = mul i64 %t, {adjoint * groups}
  %J = getelementptr {single}, ptr %adjoint, i64 %J.at
  %output.at = mul i64 %t, {outputs}
  %row.output = getelementptr double, ptr %output, i64 %output.at
  %slope.at = mul i64 %t, %pitch
  %row.slope = getelementptr double, ptr %slope, i64 %slope.at
{of_row}
  br label %direction
direction:
  %k = phi i64 [0, %row], [%k.next, %result]
  %S.at = mul i64 %k, {width}
  %S = getelementptr double, ptr %slopes, i64 %S.at
  %first.here = getelementptr i64, ptr %first, i64 %k
{of_direction}
  %none = icmp sge i64 {begin}, {end}
  br i1 %none, label %result, label %element
element:
  %j = phi i64 [{begin}, %direction], [%j.next, %element]
{sum_phis}
{of_element}
  %j.next = add i64 %j, 1
  %more.elements = icmp slt i64 %j.next, {end}
  br i1 %more.elements, label %element, label %result
result:
{total_phis}
{of_result}
  %k.next = add i64 %k, 1
  %more.directions = icmp slt i64 %k.next, %directions
  br i1 %more.directions, label %direction, label %row.end
row.end:
  %t.next = add i64 %t, 1
  %more.rows = icmp slt i64 %t.next, %samples
  br i1 %more.rows, label %row, label %done
done:
  ret void
}}
"""
