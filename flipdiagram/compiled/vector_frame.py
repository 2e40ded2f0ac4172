"""The part of a vectorised kernel that is the same for every diagram: which channels, until when, and what is kept."""

FRAME = """; A Drake diagram, {W} channels at a time, printed by flipdiagram.compiled.vector.
declare i64 @llvm.smin.i64(i64, i64)
declare i64 @llvm.vector.reduce.smin.v{W}i64(<{W} x i64>)
declare i64 @llvm.vector.reduce.smax.v{W}i64(<{W} x i64>)
declare <{W} x double> @llvm.fma.v{W}f64(<{W} x double>, <{W} x double>, <{W} x double>)
declare <{W} x double> @llvm.copysign.v{W}f64(<{W} x double>, <{W} x double>)
declare <{W} x double> @llvm.fabs.v{W}f64(<{W} x double>)
declare <{W} x double> @llvm.sqrt.v{W}f64(<{W} x double>)
declare <{W} x double> @llvm.floor.v{W}f64(<{W} x double>)
declare <{W} x double> @llvm.ceil.v{W}f64(<{W} x double>)
{declarations}
!0 = !{{!"branch_weights", i32 1, i32 1000000}}

define void @kernel(
  i64 %first, i64 %last, ptr %ticks, ptr %start, ptr %state, i64 %states, ptr %parameter, i64 %stride,
  ptr %series, i64 %span, i64 %inputs, i64 %held, i64 %every, ptr %signal, i64 %signals, ptr %column,
  ptr %log, i64 %rows, i64 %width
) nounwind {{
entry:
  %channels = alloca <{W} x i64>, align 64
  %lengths = alloca <{W} x i64>, align 64
  %starts = alloca <{W} x double>, align 64
  %sig = alloca [{signals} x <{W} x double>], align 64
  %own = getelementptr <{W} x double>, ptr %sig, i64 {outputs}
  %par = alloca [{parameters} x <{W} x double>], align 64
  %greatest = sub i64 %last, 1
  br label %block

block:
  %b = phi i64 [ %first, %entry ], [ %b.next, %done ]
  %some = icmp slt i64 %b, %last
  br i1 %some, label %load, label %end

load:                                             ; lane by lane: which channel, and its numbers
  %l = phi i64 [ 0, %block ], [ %l.next, %load.end ]
  %wanted = add i64 %b, %l
  %c = call i64 @llvm.smin.i64(i64 %wanted, i64 %greatest)
  %channel.at = getelementptr i64, ptr %channels, i64 %l
  store i64 %c, ptr %channel.at
  %ticks.at = getelementptr i64, ptr %ticks, i64 %c
  %length = load i64, ptr %ticks.at
  %length.at = getelementptr i64, ptr %lengths, i64 %l
  store i64 %length, ptr %length.at
  %start.at = getelementptr i64, ptr %start, i64 %c
  %start.tick = load i64, ptr %start.at
  %start.number = sitofp i64 %start.tick to double
  %starts.at = getelementptr double, ptr %starts, i64 %l
  store double %start.number, ptr %starts.at
  %state.row = mul i64 %c, %states
  %parameter.row = mul i64 %c, %stride
  br label %load.state
load.state:
  %si = phi i64 [ 0, %load ], [ %si.next, %load.state.one ]
  %si.more = icmp slt i64 %si, %states
  br i1 %si.more, label %load.state.one, label %load.parameter
load.state.one:
  %si.from = add i64 %state.row, %si
  %si.from.at = getelementptr double, ptr %state, i64 %si.from
  %si.value = load double, ptr %si.from.at
  %si.block = mul i64 %si, {W}
  %si.to = add i64 %si.block, %l
  %si.to.at = getelementptr double, ptr %own, i64 %si.to
  store double %si.value, ptr %si.to.at
  %si.next = add i64 %si, 1
  br label %load.state
load.parameter:
  %pi = phi i64 [ 0, %load.state ], [ %pi.next, %load.parameter.one ]
  %pi.more = icmp slt i64 %pi, {parameters}
  br i1 %pi.more, label %load.parameter.one, label %load.end
load.parameter.one:
  %pi.from = add i64 %parameter.row, %pi
  %pi.from.at = getelementptr double, ptr %parameter, i64 %pi.from
  %pi.value = load double, ptr %pi.from.at
  %pi.block = mul i64 %pi, {W}
  %pi.to = add i64 %pi.block, %l
  %pi.to.at = getelementptr double, ptr %par, i64 %pi.to
  store double %pi.value, ptr %pi.to.at
  %pi.next = add i64 %pi, 1
  br label %load.parameter
load.end:
  %l.next = add i64 %l, 1
  %l.more = icmp slt i64 %l.next, {W}
  br i1 %l.more, label %load, label %loaded

loaded:
  %length.all = load <{W} x i64>, ptr %lengths, align 64
  %first_tick = load <{W} x double>, ptr %starts, align 64
  %longest = call i64 @llvm.vector.reduce.smax.v{W}i64(<{W} x i64> %length.all)
  %logs = icmp sgt i64 %rows, 0
  %due.0 = select i1 %logs, i64 0, i64 {never}
{loaded}

segment:                                          ; from the tick reached to the next event
  %reached = phi i64 [ 0, %{loaded_label} ], [ %next, %next.event ]
  %over = phi i64 [ -1, %{loaded_label} ], [ %next, %next.event ]
  %row = phi i64 [ 0, %{loaded_label} ], [ %row.after, %next.event ]
  %due = phi i64 [ %due.0, %{loaded_label} ], [ %due.after, %next.event ]
{segment_phis}
  %over.one = insertelement <{W} x i64> poison, i64 %over, i32 0
  %over.all = shufflevector <{W} x i64> %over.one, <{W} x i64> poison, <{W} x i32> zeroinitializer
  %runs = icmp sgt <{W} x i64> %length.all, %over.all
  %ends = select <{W} x i1> %runs, <{W} x i64> %length.all, <{W} x i64> splat (i64 {never})
  %soonest = call i64 @llvm.vector.reduce.smin.v{W}i64(<{W} x i64> %ends)
  %next = call i64 @llvm.smin.i64(i64 %soonest, i64 %due)
  %moves = icmp slt i64 %reached, %next
  br i1 %moves, label %tick, label %event

tick:
  %k = phi i64 [ %reached, %segment ], [ %k.next, %{ticked_label} ]
{tick_phis}
{tick}

event:
{event_phis}
{store}
  %is.due = icmp eq i64 %next, %due
  br i1 %is.due, label %due.now, label %keep

due.now:                                          ; outputs and states of all lanes, then a row for each that runs
{due}
rows.loop:
  %rl = phi i64 [ 0, %{due_label} ], [ %rl.next, %rows.end ]
  %rl.length.at = getelementptr i64, ptr %lengths, i64 %rl
  %rl.length = load i64, ptr %rl.length.at
  %rl.runs = icmp sge i64 %rl.length, %next
  br i1 %rl.runs, label %rows.one, label %rows.end
rows.one:
  %rl.channel.at = getelementptr i64, ptr %channels, i64 %rl
  %rl.channel = load i64, ptr %rl.channel.at
  %rl.first = mul i64 %rl.channel, %rows
  %rl.row = add i64 %rl.first, %row
  %rl.place = mul i64 %rl.row, %width
  br label %rows.column
rows.column:
  %ci = phi i64 [ 0, %rows.one ], [ %ci.next, %rows.column.one ]
  %ci.more = icmp slt i64 %ci, %width
  br i1 %ci.more, label %rows.column.one, label %rows.end
rows.column.one:
  %ci.at = getelementptr i64, ptr %column, i64 %ci
  %ci.signal = load i64, ptr %ci.at
  %ci.block = mul i64 %ci.signal, {W}
  %ci.from = add i64 %ci.block, %rl
  %ci.from.at = getelementptr double, ptr %sig, i64 %ci.from
  %ci.value = load double, ptr %ci.from.at
  %ci.to = add i64 %rl.place, %ci
  %ci.to.at = getelementptr double, ptr %log, i64 %ci.to
  store double %ci.value, ptr %ci.to.at
  %ci.next = add i64 %ci, 1
  br label %rows.column
rows.end:
  %rl.next = add i64 %rl, 1
  %rl.more = icmp slt i64 %rl.next, {W}
  br i1 %rl.more, label %rows.loop, label %rows.done
rows.done:
  %row.next = add i64 %row, 1
  %due.next = add i64 %due, %every
  %rows.more = icmp slt i64 %row.next, %rows
  %due.or.never = select i1 %rows.more, i64 %due.next, i64 {never}
  br label %keep

keep:                                             ; the states of the channels that end here
  %row.after = phi i64 [ %row, %event ], [ %row.next, %rows.done ]
  %due.after = phi i64 [ %due, %event ], [ %due.or.never, %rows.done ]
  br label %keep.lane
keep.lane:
  %kl = phi i64 [ 0, %keep ], [ %kl.next, %keep.end ]
  %kl.length.at = getelementptr i64, ptr %lengths, i64 %kl
  %kl.length = load i64, ptr %kl.length.at
  %kl.over = icmp eq i64 %kl.length, %next
  br i1 %kl.over, label %keep.one, label %keep.end
keep.one:
  %kl.channel.at = getelementptr i64, ptr %channels, i64 %kl
  %kl.channel = load i64, ptr %kl.channel.at
  %kl.row = mul i64 %kl.channel, %states
  br label %keep.state
keep.state:
  %ki = phi i64 [ 0, %keep.one ], [ %ki.next, %keep.state.one ]
  %ki.more = icmp slt i64 %ki, %states
  br i1 %ki.more, label %keep.state.one, label %keep.end
keep.state.one:
  %ki.block = mul i64 %ki, {W}
  %ki.from = add i64 %ki.block, %kl
  %ki.from.at = getelementptr double, ptr %own, i64 %ki.from
  %ki.value = load double, ptr %ki.from.at
  %ki.to = add i64 %kl.row, %ki
  %ki.to.at = getelementptr double, ptr %state, i64 %ki.to
  store double %ki.value, ptr %ki.to.at
  %ki.next = add i64 %ki, 1
  br label %keep.state
keep.end:
  %kl.next = add i64 %kl, 1
  %kl.more = icmp slt i64 %kl.next, {W}
  br i1 %kl.more, label %keep.lane, label %next.event
next.event:
  %goes.on = icmp slt i64 %next, %longest
  br i1 %goes.on, label %segment, label %done

done:
  %b.next = add i64 %b, {W}
  br label %block

end:
  ret void
}}
"""
