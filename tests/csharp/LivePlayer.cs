// The commands of tests/live for a PoseSampler and a LiveCamera. Messages are in base64.
using System;
using System.Diagnostics;
using System.Globalization;
using System.Linq;
using System.Text.RegularExpressions;
using Sightline.Client;
using Sightline.V1;

static class LivePlayer {
    static PoseSampler sampler;
    static LiveCamera live;

    // Null: it is no command of this kind.
    public static string Run(string line) {
        switch (Regex.Match(line, "\"(.*?)\"").Groups[1].Value) {
            case "sampler_new": sampler = new PoseSampler(); return "{\"sampler\": {}}";
            case "sampler_add": return "{\"taken\": " + Json(sampler.Add(CameraReply.Parser.ParseFrom(Player.Bytes(line, "sampler_add")))) + "}";
            case "sampler_shift": return Shift(Numbers(line, "sampler_shift"));
            case "sampler_at": return SampleAt(line);
            case "live_open": return Open(line);
            case "live_tick": return Tick(Sightline.V1.Tick.Parser.ParseFrom(Player.Bytes(line, "live_tick")));
            case "live_close": return Close();
            default: return null;
        }
    }

    static string Shift(double[] by) {
        sampler.Shift(new Double3(by[0], by[1], by[2]));
        return "{\"sampler\": {}}";
    }

    static string SampleAt(string line) {
        var target = Numbers(line, "target");
        var shown = sampler.Sample(Numbers(line, "time_s")[0], target.Length == 3 ? new Double3(target[0], target[1], target[2]) : (Double3?)null);
        if (shown == null) return "{\"sample\": null}";
        return "{\"sample\": [" + Json(shown.Value.Position) + ", " + Json(shown.Value.Rotation) + ", " + Json(shown.Value.FieldOfView) + ", " +
               (shown.Value.Cut ? 1 : 0) + "]}";
    }

    static string Open(string line) {
        var opening = OpenSession.Parser.ParseFrom(Player.Bytes(line, "live_open"));
        var camera = new CameraOptions { SceneFile = Player.TextOrNull(line, "scene_file") };
        var options = new LiveOptions { Camera = camera, Wait = TimeSpan.FromSeconds(Numbers(line, "wait_s")[0]) };
        live = new LiveCamera(new[] { "http://" + Player.Text(line, "address") }, opening, options);
        return "{\"live\": {}}";
    }

    static string Tick(Tick tick) {
        var took = Stopwatch.StartNew();
        LiveView view;
        try {
            view = live.Tick(tick);
        } catch (FailedException error) {
            return "{\"error\": \"" + Player.CodeName(error) + "\"}";
        } catch (QueueFullException) {
            return "{\"error\": \"QUEUE_FULL\"}";
        }
        double tookS = took.Elapsed.TotalSeconds;
        return "{\"view\": {\"position\": [" + Json(view.Shown.Position) + "], \"rotation\": [" + Json(view.Shown.Rotation) + "], \"field_of_view\": " +
               Json(view.Shown.FieldOfView) + ", \"cut\": " + Json(view.Shown.Cut) + ", \"age_s\": " + Json(view.AgeS) + ", \"source\": \"" +
               view.Source.ToString().ToLowerInvariant() + "\", \"sequence\": " + view.Sequence + ", \"reply\": " + (view.Reply?.Sequence ?? 0) + ", \"hash\": \"" +
               (view.Reply?.MirrorHash ?? 0) + "\", \"refusals\": [" + string.Join(", ", view.Refusals.Select(refusal => refusal.Sequence)) + "], \"refusal_codes\": [" +
               string.Join(", ", view.Refusals.Select(refusal => (int)refusal.Code)) + "], \"trouble\": " + Json(view.Trouble != null) + ", \"took_s\": " + Json(tookS) + "}}";
    }

    static string Close() {
        var took = Stopwatch.StartNew();
        live.Dispose();
        return "{\"live_closed\": {\"took_s\": " + Json(took.Elapsed.TotalSeconds) + ", \"resyncs\": " + live.Resyncs + ", \"resumes\": " + live.Resumes + "}}";
    }

    // One number, or a list of them.
    static double[] Numbers(string line, string name) {
        var text = Regex.Match(line, "\"" + name + "\": (\\[(.*?)\\]|([^,}]*))");
        var words = (text.Groups[2].Success ? text.Groups[2] : text.Groups[3]).Value.Split(new[] { ", " }, StringSplitOptions.RemoveEmptyEntries);
        return words.Select(word => double.Parse(word, CultureInfo.InvariantCulture)).ToArray();
    }

    static string Json(double value) { return value.ToString("R", CultureInfo.InvariantCulture); }
    static string Json(bool value) { return value ? "true" : "false"; }
    static string Json(Double3 v) { return Json(v.X) + ", " + Json(v.Y) + ", " + Json(v.Z); }
    static string Json(DoubleQuaternion q) { return Json(q.X) + ", " + Json(q.Y) + ", " + Json(q.Z) + ", " + Json(q.W); }
}
