// Plays conformance sessions with the C# client; messages are in base64. tests/conformance/README.md describes the protocol.
using System;
using System.Collections.Generic;
using System.IO;
using System.Linq;
using System.Text.RegularExpressions;
using System.Threading.Tasks;
using Google.Protobuf;
using Sightline.Client;
using Sightline.V1;

static class Player {
    static SightlineCamera camera;

    static void Main() {
        for (string line; (line = Console.In.ReadLine()) != null;) {
            Console.Out.WriteLine(LivePlayer.Run(line) ?? Run(line).GetAwaiter().GetResult());
            Console.Out.Flush();
        }
    }

    static async Task<string> Run(string line) {
        try {
            if (line.StartsWith("{\"open\"")) return Message("opened", await Open(line));
            if (line.StartsWith("{\"tick\"")) return Message("camera", await camera.TickAsync(Tick.Parser.ParseFrom(Bytes(line, "tick"))));
            await camera.CloseAsync();
            return "{\"closed\": {\"resyncs\": " + camera.Resyncs + ", \"resumes\": " + camera.Resumes + "}}";
        } catch (RefusedException error) {
            return Message("refused", error.Error);
        } catch (FailedException error) {
            var violations = error.Violations.Select(v => "{\"field\": " + Quoted(v.Field) + ", \"description\": " + Quoted(v.Description) + "}");
            return "{\"failed\": {\"code\": \"" + CodeName(error) + "\", \"violations\": [" + string.Join(", ", violations) + "]}}";
        }
    }

    static async Task<SessionOpened> Open(string line) {
        var opening = OpenSession.Parser.ParseFrom(Bytes(line, "open"));
        var uploads = Regex.Match(line, "\"uploads\": \\[(.*?)\\]").Groups[1].Value;
        var files = Regex.Matches(uploads, "\"(.*?)\"").Cast<Match>().Select(file => File.ReadAllBytes(file.Groups[1].Value)).ToList();
        var options = new CameraOptions { SceneFile = TextOrNull(line, "scene_file"), Uploads = files };
        if (TextOrNull(line, "scene") is string scene) options.Scene = File.ReadAllBytes(scene);
        camera = await SightlineCamera.OpenAsync(new[] { "http://" + Text(line, "address") }, opening, options);
        return camera.Opened;
    }

    public static string CodeName(FailedException error) { return Regex.Replace(error.Code.ToString(), "(?<=.)([A-Z])", "_$1").ToUpperInvariant(); }
    public static string Text(string line, string name) { return Regex.Match(line, "\"" + name + "\": \"(.*?)\"").Groups[1].Value; }
    public static string TextOrNull(string line, string name) { return line.Contains("\"" + name + "\": \"") ? Text(line, name) : null; }
    public static byte[] Bytes(string line, string name) { return Convert.FromBase64String(Text(line, name)); }
    static string Message(string name, IMessage message) { return "{\"" + name + "\": \"" + Convert.ToBase64String(message.ToByteArray()) + "\"}"; }
    static string Quoted(string text) { return "\"" + text.Replace("\\", "\\\\").Replace("\"", "\\\"") + "\""; }
}
