#!/usr/bin/env bash
# Compiles the C# client with Mono's compiler, against declarations of the libraries that only NuGet has: build.sh SOURCE_ROOT WORK_FOLDER. It makes the
# player of the conformance sessions and the example, and checks the code of the pages for Unity and Godot.
set -euo pipefail
root=$1 work=$2
here=$root/tests/csharp declarations=$root/tests/csharp/declarations
rm -rf "$work"
mkdir -p "$work/generated" "$work/pages"
find "$root/proto/sightline" -name '*.proto' -print0 | xargs -0 protoc -I "$root/proto" --csharp_out="$work/generated"
compile() {
  mcs -langversion:latest -warnaserror -nowarn:0067,0169,0414,0649 -define:GOOGLE_PROTOBUF_REFSTRUCT_COMPATIBILITY_MODE "$@"
}
compile -target:library -out:"$work/libraries.dll" "$declarations/GoogleProtobuf.cs" "$declarations/Grpc.cs" "$work"/generated/*.cs
compile -target:library -r:"$work/libraries.dll" -out:"$work/Sightline.Client.dll" "$root"/client/csharp/*.cs
both=(-r:"$work/libraries.dll" -r:"$work/Sightline.Client.dll")
compile "${both[@]}" -out:"$work/player.exe" "$here/Player.cs" "$here/LivePlayer.cs"
compile "${both[@]}" -out:"$work/example.exe" "$root/client/csharp/example/Program.cs"
for page in unity:UnityEngine godot:Godot; do
  name=${page%:*}
  python3 "$root/tests/engines/take_block.py" "$root/client/engines/$name.md" csharp "$work/pages/$name.cs"
  compile -target:library "${both[@]}" -out:"$work/pages/$name.dll" "$declarations/${page#*:}.cs" "$work/pages/$name"*.cs
done
[ "$(wc -l < "$root/client/csharp/example/Program.cs")" -lt 60 ]
